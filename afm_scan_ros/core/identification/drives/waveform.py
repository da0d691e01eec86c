"""What one axis is driven with: a voltage known at every sample."""

from itertools import pairwise
from typing import Protocol

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.types import Array


class Waveform(Protocol):
    """A drive of one axis from rest at 0 V back to rest at 0 V, known at every sample.

    So a record of any length is generated block by block.
    """

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        ...

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        ...

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        ...


def whole(waveform: Waveform) -> Array:
    """Drive in V at every sample, shape (n,)."""
    return waveform.voltage(np.arange(waveform.total_samples, dtype=np.float64))


@frozen(eq=False)
class InTurn:
    """Waveforms of one sample period, one after another."""

    parts: tuple[Waveform, ...]
    _edges: Array = field(init=False)

    @_edges.default
    def _begin(self) -> Array:
        return np.cumsum([0.0, *(part.total_samples for part in self.parts)])

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.parts[0].sample_period

    @property
    def total_samples(self) -> int:
        """Samples of all parts."""
        return int(self._edges[-1])

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        volts = np.zeros_like(samples)
        for part, (begin, end) in zip(self.parts, pairwise(self._edges), strict=True):
            here = (samples >= begin) & (samples < end)
            volts[here] = part.voltage(samples[here] - begin)
        return volts


@frozen(eq=False)
class Together:
    """Two waveforms of equal length, added."""

    one: Waveform
    other: Waveform

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.one.sample_period

    @property
    def total_samples(self) -> int:
        """Samples of either."""
        return self.one.total_samples

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        return self.one.voltage(samples) + self.other.voltage(samples)
