"""Smooth motion from level to level.

What one axis is driven with: a voltage known at every sample.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Waypoints:
    """Smooth motion from level to level, each taking its time, with a pause of zero distance.

    ``samples[i]`` is when ``levels[i]`` is reached. The speed of a move rises and falls as a
    half cosine over ``blend`` samples (half the move where that is shorter) and is constant
    between, so the resonance is not struck at the corners.
    """

    sample_period: float
    levels: Array
    samples: Array
    blend: float

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return int(self.samples[-1]) + 1

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        move = np.clip(np.searchsorted(self.samples, samples, "right") - 1, 0, len(self.levels) - 2)
        start, length = self.samples[move], np.diff(self.samples)[move]
        share = _smooth_share(samples - start, length, np.minimum(self.blend, length / 2))
        return np.asarray(self.levels[move] + share * np.diff(self.levels)[move])


def _smooth_share(elapsed: Array, length: Array, blend: Array) -> Array:
    """Share of a move that is done, 0 to 1, its speed rising and falling over ``blend``."""
    mirrored = elapsed > length / 2
    near = np.where(mirrored, length - elapsed, elapsed)
    rising = np.minimum(near, blend)
    path = rising / 2 - blend / (2 * np.pi) * np.sin(np.pi * rising / blend) + (near - rising)
    share: Array = path / (length - blend)
    return np.where(mirrored, 1.0 - share, share)


def moves(levels: Sequence[float], seconds: Sequence[float], rate: float) -> Waypoints:
    """Move from level to level (V), each in its seconds, corners rounded by a fifth of a move."""
    lengths = np.rint(rate * np.asarray(seconds))
    samples = np.cumsum([0.0, *lengths])
    return Waypoints(1.0 / rate, np.asarray(levels), samples, max(1.0, 0.2 * lengths.min()))


def still(seconds: float, rate: float) -> Waypoints:
    """Rest at 0 V."""
    return moves([0.0, 0.0], [seconds], rate)


def triangles(amplitude: float, frequency: float, cycles: int, rate: float) -> Waypoints:
    """Rounded triangles about 0 V that begin and end there."""
    path = [0.0, *[amplitude, -amplitude] * cycles, 0.0]
    lengths = [0.25, *[0.5] * (2 * cycles - 1), 0.25]
    return moves(path, [length / frequency for length in lengths], rate)


def fading(amplitude: float, swing: float, rate: float) -> Waypoints:
    """Fifty swings, each of ``swing`` s, that fade from an amplitude and leave it depolarised."""
    swings = amplitude * (-0.9) ** np.arange(50)
    return moves([0.0, *swings, 0.0], [swing] * (len(swings) + 1), rate)


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


@frozen(eq=False)
class Scaled:
    """A waveform of which the voltages and the times are multiplied."""

    wave: Waveform
    size: float
    time: float

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.time * self.wave.sample_period

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return self.wave.total_samples

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        return self.size * self.wave.voltage(samples)


@frozen(eq=False)
class Sampled:
    """A drive of which the voltage at every sample is given: ``values`` (n,), in V."""

    sample_period: float
    values: Array

    @property
    def total_samples(self) -> int:
        """Samples given."""
        return len(self.values)

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        return np.asarray(self.values[samples.astype(np.int64)])


@frozen(eq=False)
class Raised:
    """A waveform about a level (V) that is reached, and left at its end, within ``seconds``."""

    wave: Waveform
    level: float
    seconds: float
    _pedestal: Waypoints = field(init=False)

    @_pedestal.default
    def _rise_and_fall(self) -> Waypoints:
        rate = 1.0 / self.wave.sample_period
        held = (self.wave.total_samples - 1) * self.wave.sample_period
        levels = [0.0, self.level, self.level, 0.0]
        return moves(levels, [self.seconds, held, self.seconds], rate)

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.wave.sample_period

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return self._pedestal.total_samples

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        last = self.wave.total_samples - 1.0
        begun = samples - self._pedestal.samples[1]
        wave = self.wave.voltage(np.clip(begun, 0.0, last))
        on = (begun >= 0.0) & (begun <= last)
        return self._pedestal.voltage(samples) + np.where(on, wave, 0.0)
