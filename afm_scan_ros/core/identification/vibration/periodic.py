"""A record of periodic drives → the spectra of its waves, each where it is steady."""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.spectra import Complex, RecordSpectra
from afm_scan_ros.core.types import Array

EXCITED = 1e-3
"""Lines of the drive below this share of its strongest are not excited."""
NEAR = 0.05
"""Share of the period by which the peak may be drawn forward: 1/(8 pi^2) of a sine's, thrice."""
ALIKE = 0.5
"""Pieces that differ by less than this share of themselves repeat, if only nearly."""


def record_spectra(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> RecordSpectra:
    """RecordSpectra of a record: drive and effective input (n, inputs), output (n, outputs).

    A period counts when the drive equals the period before, so that it is steady. Raises
    InputError where no two periods in succession are.
    """
    period = repetition(drive)
    count = len(drive) // period
    drives, inputs, outputs = (
        signal[: count * period].reshape(count, period, -1) for signal in (drive, effective, output)
    )
    steady = 1 + np.flatnonzero(np.all(drives[1:] == drives[:-1], axis=(1, 2)))
    runs = np.split(steady, np.flatnonzero(np.diff(steady) > 1) + 1)
    runs = [run for run in runs if len(run) > 1]
    if not runs:
        raise InputError(_unsteady(drives))
    lines = _excited(drives[steady])
    omega = np.asarray(lines * (2.0 * np.pi / (period * sample_period)), dtype=np.float64)
    given, got = ([_lines(signal[run], lines) for run in runs] for signal in (inputs, outputs))
    return RecordSpectra(
        omega,
        np.array([wave.mean(axis=0) for wave in given]),
        np.array([wave.mean(axis=0) for wave in got]),
        np.array([np.var(wave, axis=0, ddof=1) / len(wave) for wave in got]),
        np.array([float(len(run)) for run in runs]),
    )


def repetition(drive: Array) -> int:
    """Period (samples) of a drive, (n, inputs): where its autocorrelation, once negative, peaks.

    The shorter overlap at longer lags draws a broad peak forward. About it the period is therefore
    the lag at which the drive differs least from itself.
    """
    size = 1 << (2 * len(drive) - 1).bit_length()
    moves = drive - drive.mean(axis=0)
    power = np.sum(np.abs(np.fft.rfft(moves, size, axis=0)) ** 2, axis=1)
    correlation = np.fft.irfft(power, size)[: len(drive)]
    first = int(np.argmax(correlation < 0.0))
    peak = first + int(np.argmax(correlation[first:]))
    lags = np.arange(round((1.0 - NEAR) * peak), min(round((1.0 + NEAR) * peak) + 1, len(drive)))
    energy = np.concatenate([[0.0], np.cumsum(np.sum(moves**2, axis=1))])
    both = energy[len(drive) - lags] + energy[-1] - energy[lags]
    return int(lags[np.argmin((both - 2.0 * correlation[lags]) / (len(drive) - lags))])


def _unsteady(drives: Array) -> str:
    """Say of pieces of a drive, (pieces, period, inputs), why none is steady."""
    count, period = drives.shape[:2]
    alike = np.linalg.norm(drives[1:] - drives[:-1]) < ALIKE * np.linalg.norm(drives)
    problem = (
        "nearly repeats itself but never exactly: it is not synchronised with the sampling; drive"
        " periods of a whole number of samples, from the sampling's own clock"
        if count > 1 and alike
        else "is never three times the same; drive a periodic multisine from the record's start"
    )
    return f"frequency record: the drive, taken in {count} pieces of {period} samples, {problem}"


def _excited(drives: Array) -> NDArray[np.int64]:
    strength = np.abs(np.fft.rfft(drives, axis=1)).mean(axis=(0, 2))
    strength[0] = 0.0
    return np.flatnonzero(strength > EXCITED * strength.max())


def _lines(signals: Array, lines: NDArray[np.int64]) -> Complex:
    return np.asarray(np.fft.rfft(signals, axis=1)[:, lines])
