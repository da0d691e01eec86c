"""A drive of any shape, a sweep, noise or steps → the frequency response, a few bins at a time.

The whole record is transformed at once. Over a few neighbouring bins the response is smooth, and so
is what the record's ends leak: both are polynomials, fitted together by least squares (the local
polynomial method of R. Pintelon and J. Schoukens, System Identification, 2nd ed., Wiley 2012,
chapter 7). What they leave of the bins is noise and nonlinearity.
"""

from collections.abc import Iterator

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.ndimage import binary_opening

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.spectra import Complex
from afm_scan_ros.core.types import Array

BINS = 17
"""Neighbouring bins that make one line of the response, at least."""
WIDTH = 1e-3
"""Share of its frequency that a line is wide, where that is more: a damping of 0.003 takes six."""
DEGREE = 2
"""Of the polynomials over them."""
EXCITED = 0.03
"""Lines that drive and moves are both below this share of their strongest at are left out."""
FEWEST = 5
"""Adjacent lines: fewer are of the way to a sweep and back, as large as no wave of it is."""


@frozen(eq=False)
class LocalResponse:
    """The response, its residual of the output, (n,); ``cycles`` is the last driven bin."""

    response: FrequencyResponse
    residual: Array
    cycles: int


def local_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> LocalResponse:
    """Response of ``output`` to ``effective``, both (n,), where the drive (V), (n,), is strong.

    One record cannot separate noise from nonlinearity: ``noise`` and ``scatter`` are the same.
    """
    driven, given, got = (transform(signal) for signal in (drive, effective, output))
    moves = np.abs(driven) * np.abs(1.0 - _turn(len(drive)))
    strong = [_mean(size, len(drive)) for size in (np.abs(driven), moves)]
    lines = np.any([size > EXCITED * size.max() for size in strong], axis=0)
    lines = binary_opening(lines, np.ones(FEWEST))
    unexplained, found = np.zeros_like(got), []
    for bins in _windows(len(drive)):
        response, deviation, coherence, residual = _local(given[bins], got[bins])
        unexplained[bins] = residual
        centre = bins[:, bins.shape[1] // 2]
        found.append(np.array([centre, response, deviation, coherence]))
    centre, response, deviation, coherence = np.hstack(found)[:, lines]
    omega = centre.real * (2.0 * np.pi / (len(drive) * sample_period))
    frequency = FrequencyResponse(omega, response, deviation.real, deviation.real, coherence.real)
    return LocalResponse(
        frequency, np.fft.irfft(unexplained, len(drive)), int(centre.real[-1]) + BINS // 2
    )


def remainder(given: Complex, got: Complex) -> Complex:
    """What no local response to ``given`` explains of ``got``, transforms (bins,) of a record."""
    residual = np.zeros_like(got)
    for bins in _windows(2 * (len(got) - 1)):
        residual[bins] = _local(given[bins], got[bins])[3]
    return residual


def _windows(samples: int) -> Iterator[NDArray[np.int64]]:
    """Bins of the lines of an octave, (lines, bins), octave by octave."""
    first, last = 1, samples // 2 + 1
    while last - first >= BINS:
        width = max(BINS, 2 * int(0.5 * WIDTH * first) + 1)
        count = max(min(first, last - first) // width, 1)
        if first + width > last:
            return
        yield first + np.arange(count * width).reshape(count, width)
        first += count * width


def _mean(size: Array, samples: int) -> Array:
    """Rms of each line."""
    return np.concatenate([np.sqrt(np.mean(size[bins] ** 2, axis=1)) for bins in _windows(samples)])


def _turn(samples: int) -> Complex:
    """Delay by a sample, (bins,)."""
    return np.asarray(np.exp(-2j * np.pi * np.arange(samples // 2 + 1) / samples))


def transform(signal: Array) -> Complex:
    """Transform by way of the differences, so that the jump from end to start leaks nothing."""
    differences = np.fft.rfft(np.diff(signal, prepend=signal[0]))
    differences[1:] /= 1.0 - _turn(len(signal))[1:]
    differences[0] = 0.0
    return np.asarray(differences)


def _local(given: Complex, got: Complex) -> tuple[Complex, Array, Array, Complex]:
    """Response, its deviation and coherence, (lines,), and the residual, (lines, bins)."""
    columns = polynomials_of(given)
    solution = np.linalg.pinv(columns)
    found = solution @ got[:, :, np.newaxis]
    residual = got - (columns @ found)[:, :, 0]
    variance = np.sum(np.abs(residual) ** 2, axis=1) / (columns.shape[1] - columns.shape[2])
    deviation = np.sqrt(variance * np.sum(np.abs(solution[:, 0]) ** 2, axis=1))
    coherence = 1.0 - variance / np.mean(np.abs(got) ** 2, axis=1)
    return found[:, 0, 0], deviation, np.maximum(coherence, 0.0), residual


def polynomials_of(given: Complex) -> Complex:
    """Columns (lines, bins, 2 DEGREE + 2): an input (lines, bins) and 1, each by powers."""
    along = np.linspace(-1.0, 1.0, given.shape[1])[:, np.newaxis] ** np.arange(DEGREE + 1)
    size = np.sqrt(np.mean(np.abs(given) ** 2, axis=1))[:, np.newaxis, np.newaxis]
    leak = np.where(size > 0.0, size, 1.0) * along
    return np.concatenate([given[:, :, np.newaxis] * along, leak], axis=2)
