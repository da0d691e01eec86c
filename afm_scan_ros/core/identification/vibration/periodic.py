"""A record of periodic drives → the spectra of its waves, each where it is steady."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.spectra import Complex, RecordSpectra
from afm_scan_ros.core.types import Array

EXCITED = 1e-3
"""Lines of the drive below this share of its strongest are not excited."""
EQUAL = 1e-6
"""Share of the drive's range by which two periods may differ and be equal: rounding, no noise."""
NEAR = 0.05
"""Share of the period by which the peak may be drawn forward: 1/(8 pi^2) of a sine's, thrice."""
ALIKE = 0.5
"""Pieces that differ by less than this share of themselves repeat, if only nearly."""


def is_periodic(drive: Array) -> bool:
    """Whether some period of a drive, (n, inputs), comes three times in succession or more."""
    return bool(steady_runs(drive))


def refuse_out_of_step(drive: Array) -> None:
    """Refuse a drive, (n, inputs), that nearly repeats, as one out of step with the sampling does.

    Raises InputError.
    """
    drives = _periods(drive, repetition(drive))
    if len(drives) > 1 and _alike(drives):
        raise InputError(_unsteady(drives))


def _alike(drives: Array) -> bool:
    """Whether pieces of a drive, (pieces, period, inputs), nearly repeat."""
    return bool(np.linalg.norm(drives[1:] - drives[:-1]) < ALIKE * np.linalg.norm(drives))


def record_spectra(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> RecordSpectra:
    """RecordSpectra of a record: drive and effective input (n, inputs), output (n, outputs).

    A period counts when the drive moves and equals the period before, so that it is steady. Raises
    InputError where no two periods in succession are.
    """
    period = repetition(drive)
    runs = _runs(drive, period)
    drives, inputs, outputs = (_periods(signal, period) for signal in (drive, effective, output))
    if not runs:
        raise InputError(_unsteady(drives))
    lines = _excited(drives[np.concatenate(runs)])
    omega = np.asarray(lines * (2.0 * np.pi / (drives.shape[1] * sample_period)), dtype=np.float64)
    given, got = ([_lines(signal[run], lines) for run in runs] for signal in (inputs, outputs))
    return RecordSpectra(
        omega,
        np.array([wave.mean(axis=0) for wave in given]),
        np.array([wave.mean(axis=0) for wave in got]),
        np.array([np.var(wave, axis=0, ddof=1) / len(wave) for wave in got]),
        np.array([float(len(run)) for run in runs]),
    )


def _periods(signal: Array, period: int) -> Array:
    """Cut a signal, (n, channels), into periods of so many samples, (periods, period, channels)."""
    count = len(signal) // period if period else 0
    return signal[: count * period].reshape(count, period, -1)


def steady_runs(drive: Array) -> list[NDArray[np.int64]]:
    """Numbers of the steady periods of a drive, (n, inputs), run by run."""
    return _runs(drive, repetition(drive))


def _runs(drive: Array, period: int) -> list[NDArray[np.int64]]:
    drives = _periods(drive, period)
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


def _unsteady(drives: Array) -> str:
    """Word why none of the pieces of a drive, (pieces, period, inputs), is steady."""
    count, period = drives.shape[:2]
    problem = (
        "nearly repeats itself but never exactly: it is not synchronised with the sampling; drive"
        " periods of a whole number of samples, from the sampling's own clock"
        if count > 1 and _alike(drives)
        else "is never three times the same; drive a periodic multisine from the record's start"
    )
    return f"frequency record: the drive, taken in {count} pieces of {period} samples, {problem}"


def _excited(drives: Array) -> NDArray[np.int64]:
    strength = np.abs(np.fft.rfft(drives, axis=1)).mean(axis=(0, 2))
    strength[0] = 0.0
    return np.flatnonzero(strength > EXCITED * strength.max())


def _lines(signals: Array, lines: NDArray[np.int64]) -> Complex:
    return np.asarray(np.fft.rfft(signals, axis=1)[:, lines])
