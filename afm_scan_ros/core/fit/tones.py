"""Sines in the residual of a record that neither its drive nor a mode explains, as mains hum.

A sine is one line of the residual's spectrum. Of noise alone, the power of one of n bins over the
mean about it exceeds ln(n / chance) with the probability ``chance``.
"""

import numpy as np
from scipy.ndimage import median_filter

from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.types import Array


def find_tones(residual: Array, drive: Array, period: float, settings: FitSettings) -> list[float]:
    """Frequencies (Hz) of the sines in a residual (m), (n,), the strongest first.

    A line at which the drive (any unit), (n,), has one of its own is left to the model.
    """
    found: list[float] = []
    window = np.hanning(len(residual))
    limit = np.log(len(residual) / settings.tone_chance)
    driven = _over_mean(_power(drive - drive.mean(), window)) > limit
    left = residual - residual.mean()
    while len(found) < settings.tone_most:
        power = _power(left, window)
        ratio = np.where(driven, 0.0, _over_mean(power))
        ratio[: int(settings.tone_cycles)] = 0.0
        line = int(np.argmax(ratio))
        if ratio[line] < limit or not _narrow(power, line):
            break
        frequency = _finest(left, window, line)
        turn = 2.0 * np.pi * frequency * np.arange(len(left))
        pair = np.column_stack([np.cos(turn), np.sin(turn)])
        left = left - pair @ np.linalg.lstsq(pair, left, rcond=None)[0]
        found.append(frequency / period)
    return found


def _power(signal: Array, window: Array) -> Array:
    return np.abs(np.fft.rfft(window * signal)) ** 2


def _over_mean(power: Array) -> Array:
    """Power over the mean of the hundred bins about it; the median of noise is ln 2 of its mean."""
    mean = median_filter(power, 101, mode="nearest") / np.log(2.0)
    return np.asarray(power / np.maximum(mean, np.finfo(float).eps * power.max() + 1e-300))


def _narrow(power: Array, line: int) -> bool:
    """Whether a line has fallen by 13 dB from the fourth bin on, where Hann's window has by 30."""
    sides = np.concatenate([power[max(line - 8, 1) : max(line - 3, 1)], power[line + 4 : line + 9]])
    return bool(power[line] > 20.0 * sides.max(initial=0.0))


def _finest(signal: Array, window: Array, line: int) -> float:
    """Cycles a sample of the sine about a bin, to a fortieth of a bin."""
    n = len(signal)
    tried = line + np.linspace(-1.0, 1.0, 81)
    waves = np.exp(-2j * np.pi * np.outer(tried / n, np.arange(n)))
    return float(tried[np.argmax(np.abs(waves @ (window * signal)))] / n)
