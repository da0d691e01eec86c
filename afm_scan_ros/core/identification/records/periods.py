"""Whether a drive repeats, and after how many samples."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from afm_scan_ros.core.types import Array

EQUAL = 1e-6
"""Share of the drive's range by which two periods may differ and be equal: rounding, no noise."""
STEEP = 2.0
"""Largest step of a part that repeats, over the median of all; a sine's is 1.41."""
NEAR = 0.05
"""Share of the period by which the peak may be drawn forward: 1/(8 pi^2) of a sine's, thrice."""


def is_periodic(drive: Array) -> bool:
    """Whether some period of a drive, (n, inputs), comes three times in succession or more."""
    return bool(_runs(drive, repetition(drive)))


def _runs(drive: Array, period: int) -> list[NDArray[np.int64]]:
    if not period:
        return []
    count = len(drive) // period
    drives = drive[: count * period].reshape(count, period, *drive.shape[1:])
    apart = np.abs(np.diff(drives, axis=0)).max(axis=(1, 2), initial=0.0)
    moving = np.ptp(drives[1:], axis=1).max(axis=1, initial=0.0) > 0.0
    steady = 1 + np.flatnonzero((apart <= EQUAL * np.ptp(drive)) & moving)
    runs = np.split(steady, np.flatnonzero(np.diff(steady) > 1) + 1)
    return [run for run in runs if len(run) > 1]


def repetition(drive: Array) -> int:
    """Period (samples) of a drive, (n, inputs).

    Ramps and rests before and after hide it from a drive's values, or show several periods for one,
    but not from its steps, which count where the drive is steady at their period.
    """
    period = _repetition(drive)
    if len(drive) > 1:
        other = _repetition(np.diff(drive, axis=0))
        if _runs(drive, other) and (other < period or not _runs(drive, period)):
            return other
    return period


def repeated_part(drive: Array) -> tuple[int, int, int] | None:
    """Longest part in which a drive, (n,), repeats: first, last and samples of a period.

    A period need not be a whole number of samples, so values may differ by a step of the drive.
    Those beyond ``STEEP`` count as so large. None of a drive that rests, or that nowhere repeats
    for two periods.
    """
    steps = np.diff(drive)
    if not steps.any():
        return None
    largest = STEEP * float(np.median(np.abs(steps[steps != 0.0])))
    period = _repetition(np.clip(steps, -largest, largest)[:, np.newaxis])
    if not 0 < period < len(drive):
        return None
    equal = np.abs(drive[period:] - drive[:-period]) <= largest
    ends = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]))).reshape(-1, 2)
    moving = [(a, b + period) for a, b in ends if np.ptp(drive[a : a + period]) > 0.0]
    first, last = max(moving, key=lambda each: each[1] - each[0], default=(0, 0))
    return (int(first), int(last), period) if last - first >= 2 * period else None


def _repetition(signal: Array) -> int:
    """Period (samples) of a signal: where its autocorrelation, once negative, peaks.

    The shorter overlap at longer lags draws a broad peak forward. About it the period is therefore
    the lag at which the signal differs least from itself.
    """
    size = next_fast_len(2 * len(signal), real=True)
    moves = signal - signal.mean(axis=0)
    power = np.sum(np.abs(rfft(moves, size, axis=0)) ** 2, axis=1)
    correlation = irfft(power, size)[: len(signal)]
    first = int(np.argmax(correlation < 0.0))
    peak = first + int(np.argmax(correlation[first:]))
    lags = np.arange(round((1.0 - NEAR) * peak), min(round((1.0 + NEAR) * peak) + 1, len(signal)))
    energy = np.concatenate([[0.0], np.cumsum(np.sum(moves**2, axis=1))])
    both = energy[len(signal) - lags] + energy[-1] - energy[lags]
    return int(lags[np.argmin((both - 2.0 * correlation[lags]) / (len(signal) - lags))])
