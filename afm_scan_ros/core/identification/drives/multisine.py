"""Periodic sums of sines with random phases."""

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
