"""The noise of signals, and a drive that was measured without its own.

A drive that is read from an amplifier's monitor has white noise, which turns it many times a
second. What has a memory of each turn would follow these, although the scanner never did.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.signal import welch

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.types import Array


def without_noise(drive: Array, half_range: float, settings: FitSettings) -> Array:
    """Return a drive (V), (n,), that is monotone between its turns, or itself if it has no noise.

    Turns are those that exceed the noise clearly. Between two of them the drive lies midway between
    the least monotone line above it and the greatest one below it. Noise as large as what plays
    resolve of half the range (V) may be the drive's own, and stays.
    """
    slack = settings.drive_turn * white_noise_of(drive, settings)
    rounding = float(np.finfo(np.float32).eps) * half_range
    if not rounding < slack < settings.play_step * half_range:
        return drive
    edges = np.concatenate([[0], turns_of(drive, slack), [len(drive) - 1]])
    result = drive.copy()
    for first, last in pairwise(edges):
        part = drive[first : last + 1]
        way = 1.0 if part[-1] >= part[0] else -1.0
        above = np.maximum.accumulate(way * part)
        below = np.minimum.accumulate(way * part[::-1])[::-1]
        result[first : last + 1] = 0.5 * way * (above + below)
    return result


def white_noise_of(drive: Array, settings: FitSettings) -> float:
    """Standard deviation (V) of the white noise in a drive (n,), 0 where there is none.

    Its power density is the same in two bands just below the Nyquist frequency, where that of a
    drive that a converter was given falls. It is the median over windows, few of which hold a jump
    or a turn of the drive.
    """
    window = settings.drive_window
    if len(drive) < 2 * window:
        return 0.0
    _, density = welch(drive, 1.0, nperseg=window, detrend="linear", average="median")
    fastest = density[-1 - window // 4 : -1]  # the Nyquist frequency itself has half of it
    lower, upper = fastest.reshape(2, -1).mean(axis=1)
    flat = lower < settings.drive_flat * upper
    return float(np.sqrt(0.5 * upper)) if flat else 0.0


@compiled
def turns_of(drive: Array, slack: float) -> NDArray[np.intp]:
    """Places of the turns of a drive (n,) that move by more than a slack (V) before and after."""
    found = np.empty(drive.size, np.intp)
    count, low, high, way = 0, 0, 0, 0
    for k in range(drive.size):
        if drive[k] > drive[high]:
            high = k
        if drive[k] < drive[low]:
            low = k
        if way >= 0 and drive[high] - drive[k] > slack:
            if way > 0:
                found[count] = high
                count += 1
            way, low = -1, k
            high = k
        elif way <= 0 and drive[k] - drive[low] > slack:
            if way < 0:
                found[count] = low
                count += 1
            way, high = 1, k
            low = k
    return found[:count]


def noise_of(signal: Array, finest: float = DEFAULT_SETTINGS.finest) -> float:
    """Standard deviation of the white noise in a signal, from third differences.

    Their variance is 1 + 9 + 9 + 1 times that of the noise, and the median of the absolute value of
    a normal variable is its standard deviation over 1.4826. It is at least what the ``finest``
    converter resolves, as a share of the signal's range: a signal made by a formula has none.
    """
    third = np.diff(signal, 3)
    robust = 1.4826 * float(np.median(np.abs(third - np.median(third)))) / np.sqrt(20.0)
    return float(max(robust, finest * float(np.ptp(signal))))


def correlation_length(residual: Array) -> float:
    """Samples of a residual (n,) that tell as much as one independent sample.

    That is the integrated autocorrelation time, summed up to where the autocorrelation first falls
    below that of noise, 2 / √n.
    """
    count = len(residual)
    spectrum = np.abs(rfft(residual - residual.mean(), 2 * count)) ** 2
    correlations = irfft(spectrum)[:count]
    correlations /= max(correlations[0], np.finfo(float).tiny)
    last = int(np.argmax(correlations < 2.0 / np.sqrt(count)))
    return float(1.0 + 2.0 * correlations[1:last].sum())
