"""Waveforms of one axis, V at every sample, (n,), from rest at 0 V back to rest at 0 V.

They are motion from level to level, periodic sums of sines, and sines of one frequency at a time.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array


def waypoints(levels: Array, samples: Array, blend: float) -> Array:
    """Smooth motion from level to level, each taking its time, with a pause of zero distance.

    ``samples[i]`` is when ``levels[i]`` is reached. The speed of a move rises and falls as a half
    cosine over ``blend`` samples (half the move where that is shorter) and is constant between, so
    that the resonance is not struck at the corners.
    """
    place = np.arange(int(samples[-1]) + 1.0)
    move = np.clip(np.searchsorted(samples, place, "right") - 1, 0, len(levels) - 2)
    start, length = samples[move], np.diff(samples)[move]
    share = _smooth_share(place - start, length, np.minimum(blend, length / 2))
    return np.asarray(levels[move] + share * np.diff(levels)[move])


def _smooth_share(elapsed: Array, length: Array, blend: Array) -> Array:
    """Share of a move that is done, 0 to 1, its speed rising and falling over ``blend``."""
    mirrored = elapsed > length / 2
    near = np.where(mirrored, length - elapsed, elapsed)
    rising = np.minimum(near, blend)
    path = rising / 2 - blend / (2 * np.pi) * np.sin(np.pi * rising / blend) + (near - rising)
    share: Array = path / (length - blend)
    return np.where(mirrored, 1.0 - share, share)


def moves(levels: Sequence[float], seconds: Sequence[float], rate: float) -> Array:
    """Move from level to level (V), each in its seconds, corners rounded by a fifth of a move."""
    lengths = np.rint(rate * np.asarray(seconds))
    samples = np.cumsum([0.0, *lengths])
    return waypoints(np.asarray(levels), samples, max(1.0, 0.2 * lengths.min()))


def still(seconds: float, rate: float) -> Array:
    """Rest at 0 V."""
    return np.zeros(int(np.rint(rate * seconds)) + 1)


def triangles(amplitude: float, frequency: float, cycles: int, rate: float) -> Array:
    """Rounded triangles about 0 V that begin and end there."""
    path = [0.0, *[amplitude, -amplitude] * cycles, 0.0]
    lengths = [0.25, *[0.5] * (2 * cycles - 1), 0.25]
    return moves(path, [length / frequency for length in lengths], rate)


def fading(amplitude: float, swing: float, rate: float) -> Array:
    """Fifty swings, each of ``swing`` s, that fade from an amplitude and leave it depolarised."""
    swings = amplitude * (-0.9) ** np.arange(50)
    return moves([0.0, *swings, 0.0], [swing] * (len(swings) + 1), rate)


def raised(wave: Array, sample_period: float, level: float, seconds: float) -> Array:
    """Put a waveform about a level (V) that is reached, and left at its end, within ``seconds``."""
    rate, held = 1.0 / sample_period, (len(wave) - 1) * sample_period
    result = moves([0.0, level, level, 0.0], [seconds, held, seconds], rate)
    first = int(np.rint(rate * seconds))
    result[first : first + len(wave)] += wave
    return result


def multisine(waves: Array, repeats: int) -> Array:
    """Periodic waves (V), (realisations, period), one after another, each repeated.

    Each fades in over its first period, and out over its last.
    """
    period = waves.shape[1]
    fade = 0.5 - 0.5 * np.cos(np.pi * np.arange(period) / period)
    envelope = np.ones((repeats, period))
    envelope[-1] = 1.0 - fade
    envelope[0] = fade
    return (waves[:, np.newaxis] * envelope).ravel()


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


REST = 0.5
"""Seconds of rest before and after a sweep."""


def chirp(
    sample_period: float,
    lowest: float,
    highest: float,
    seconds: float,
    amplitude: float,
    corner: float,
    fade: float,
) -> Array:
    """A sine whose frequency rises, or falls, evenly between two (Hz).

    The amplitude (V) falls as 1/f above ``corner`` Hz and fades in and out over ``fade`` s.
    """
    samples = np.arange(round((seconds + 2.0 * REST) / sample_period))
    elapsed = np.clip(samples * sample_period - REST, 0.0, seconds)
    rate = (highest - lowest) / seconds
    frequency = lowest + rate * elapsed
    phase = 2.0 * np.pi * (lowest + rate * elapsed / 2.0) * elapsed
    near = np.minimum(elapsed, seconds - elapsed) / fade
    envelope = np.sin(np.pi / 2.0 * np.minimum(near, 1.0)) ** 2
    envelope *= np.minimum(1.0, corner / frequency)
    return np.asarray(amplitude * envelope * np.sin(phase))


def stepped_sine(
    frequencies: Array, sample_period: float, dwell: float, amplitude: float, corner: float
) -> Array:
    """Sines of one frequency (Hz) after another, whole cycles each, of ``dwell`` s at least.

    The amplitude (V) falls as 1/f above ``corner`` Hz; every step begins and ends at 0 V.
    """
    lengths = np.ceil(dwell * frequencies) / frequencies
    starts = REST + np.concatenate([[0.0], np.cumsum(lengths)])
    samples = np.arange(round(float(starts[-1] + REST) / sample_period))
    time = np.clip(samples * sample_period, starts[0], starts[-1])
    step = np.clip(np.searchsorted(starts, time, "right") - 1, 0, None)
    frequency = frequencies[np.minimum(step, len(frequencies) - 1)]
    phase = 2.0 * np.pi * frequency * (time - starts[step])
    return np.asarray(amplitude * np.minimum(1.0, corner / frequency) * np.sin(phase))
