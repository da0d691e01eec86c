"""Drives as waveforms: motion from level to level, and periodic sums of sines.

What one axis is driven with: a voltage known at every sample.

Drives that show the frequency response one frequency at a time: a chirp, and stepped sines.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

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
class _Changed:
    """What is made of a waveform, and as long."""

    wave: Waveform

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.wave.sample_period

    @property
    def total_samples(self) -> int:
        """Samples from rest to rest."""
        return self.wave.total_samples


@frozen(eq=False)
class Together(_Changed):
    """Two waveforms of equal length, added."""

    other: Waveform

    def voltage(self, samples: Array) -> Array:
        """Drive in V at the sample indices given, shape (n,)."""
        return self.wave.voltage(samples) + self.other.voltage(samples)


@frozen(eq=False)
class Scaled(_Changed):
    """A waveform of which the voltages and the times are multiplied."""

    size: float
    time: float

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.time * self.wave.sample_period

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
class Raised(_Changed):
    """A waveform about a level (V) that is reached, and left at its end, within ``seconds``."""

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
