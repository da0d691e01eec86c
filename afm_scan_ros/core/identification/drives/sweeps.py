"""Drives that show the frequency response one frequency at a time: a chirp, and stepped sines."""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.types import Array


@frozen
class Chirp:
    """A sine whose frequency rises evenly, at rest for ``rest`` s before and after.

    The amplitude (V) falls as 1/f above ``corner`` Hz and fades in and out over ``fade`` s.
    """

    sample_period: float = 2e-5
    lowest: float = 2.0
    highest: float = 1000.0
    seconds: float = 14.0
    amplitude: float = 0.2
    corner: float = 200.0
    fade: float = 0.5
    rest: float = 0.5

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return round((self.seconds + 2.0 * self.rest) / self.sample_period)

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        elapsed = np.clip(samples * self.sample_period - self.rest, 0.0, self.seconds)
        rate = (self.highest - self.lowest) / self.seconds
        frequency = self.lowest + rate * elapsed
        phase = 2.0 * np.pi * (self.lowest + rate * elapsed / 2.0) * elapsed
        near = np.minimum(elapsed, self.seconds - elapsed) / self.fade
        envelope = np.sin(np.pi / 2.0 * np.minimum(near, 1.0)) ** 2
        envelope *= np.minimum(1.0, self.corner / frequency)
        return np.asarray(self.amplitude * envelope * np.sin(phase))


@frozen(eq=False)
class SteppedSine:
    """Sines of one frequency after another, whole cycles each, at rest before and after.

    The amplitude (V) falls as 1/f above ``corner`` Hz; every step begins and ends at 0 V.
    """

    frequencies: Array
    """Hz"""
    sample_period: float = 2e-5
    dwell: float = 0.25
    """Seconds that a step lasts at least."""
    amplitude: float = 0.2
    corner: float = 200.0
    rest: float = 0.5
    _starts: Array = field(init=False)

    @_starts.default
    def _begin(self) -> Array:
        lengths = np.ceil(self.dwell * self.frequencies) / self.frequencies
        return np.asarray(self.rest + np.concatenate([[0.0], np.cumsum(lengths)]))

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return round(float(self._starts[-1] + self.rest) / self.sample_period)

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        time = np.clip(samples * self.sample_period, self._starts[0], self._starts[-1])
        step = np.clip(np.searchsorted(self._starts, time, "right") - 1, 0, None)
        frequency = self.frequencies[np.minimum(step, len(self.frequencies) - 1)]
        phase = 2.0 * np.pi * frequency * (time - self._starts[step])
        size = self.amplitude * np.minimum(1.0, self.corner / frequency)
        return np.asarray(size * np.sin(phase))
