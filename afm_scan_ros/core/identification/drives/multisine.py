"""Periodic sums of sines with random phases.

Drives that show the frequency response one frequency at a time: a chirp, and stepped sines.
"""

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Multisine:
    """Random-phase multisines one after another, each repeated, fading in and out over a period."""

    sample_period: float
    waves: Array
    """One period each, V, shape (realisations, period)."""
    repeats: int
    """Periods of each wave, the fades included."""
    _fade: Array = field(init=False)

    @_fade.default
    def _fade_in(self) -> Array:
        return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(self.period) / self.period))

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return len(self.waves) * self.repeats * self.period

    @property
    def period(self) -> int:
        """Samples in one period."""
        return len(self.waves[0])

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        turn, within = np.divmod(samples.astype(np.int64), self.period)
        wave, repeat = np.divmod(turn, self.repeats)
        fade = self._fade[within]
        envelope = np.where(repeat == 0, fade, np.where(repeat == self.repeats - 1, 1 - fade, 1.0))
        return np.asarray(self.waves[wave, within] * envelope)


def random_phase_waves(
    lines: NDArray[np.int64], amplitudes: Array, period: int, phases: Array
) -> Array:
    """Waves of one period each, (draws, period), that peak at 1 V.

    ``lines`` are the cycles in a period, (m,), ``amplitudes`` their relative sizes, (m,), and
    ``phases`` in turns, (draws, m).
    """
    spectrum = np.zeros((len(phases), period // 2 + 1), dtype=np.complex128)
    spectrum[:, lines] = amplitudes * np.exp(2j * np.pi * phases)
    waves = np.fft.irfft(spectrum, period)
    return np.asarray(waves / np.abs(waves).max(axis=1, keepdims=True))


def waves_between(
    lowest: float, highest: float, period: int, rate: float, draw: int, corner: float = 200.0
) -> Array:
    """Wave of one period that peaks at 1 V, (1, period), with every line between two frequencies.

    Above ``corner`` Hz it falls as 1/f, so that it seldom turns round; ``draw`` is the seed of its
    phases.
    """
    seconds = period / rate
    lines = np.arange(round(lowest * seconds), round(highest * seconds) + 1)
    amplitudes = np.minimum(1.0, corner * seconds / lines)
    phases = np.random.default_rng(draw).random((1, len(lines)))
    return random_phase_waves(lines, amplitudes, period, phases)


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
