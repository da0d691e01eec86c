"""The frequency response of a record whose drive is of any shape, by local fits.

A local fit transforms the whole record at once. Over a few neighbouring bins the response is
smooth, and so is what the record's ends leak: both are polynomials, fitted together by least
squares (the local polynomial method of R. Pintelon and J. Schoukens, System Identification, 2nd
ed., Wiley 2012, chapter 7). What they leave of the bins is noise and nonlinearity.
"""

from collections.abc import Iterator

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.ndimage import binary_opening

from afm_scan_ros.core.types import Array, Complex


@frozen(eq=False)
class FrequencyResponse:
    """Response of the sampled system, (lines,), at ``frequency`` (Hz), and its ``deviation``.

    ``deviation`` is a standard deviation. ``coherence`` is the share of the output's power that the
    input explains.
    """

    frequency: Array
    response: Complex
    deviation: Array
    coherence: Array


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


def local_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> FrequencyResponse:
    """Response of ``output`` to ``effective``, both (n,), where the drive (V), (n,), is strong."""
    driven, given, got = (transform(signal) for signal in (drive, effective, output))
    moves = np.abs(driven) * np.abs(1.0 - _turn(len(drive)))
    strong = [_mean(size, len(drive)) for size in (np.abs(driven), moves)]
    lines = np.any([size > EXCITED * size.max(initial=0.0) for size in strong], axis=0)
    lines = binary_opening(lines, np.ones(FEWEST))
    found = [np.zeros((4, 0), np.complex128)]
    for bins in _windows(len(drive)):
        centre = bins[:, bins.shape[1] // 2]
        found.append(np.array([centre, *_local(given[bins], got[bins])]))
    centre, response, deviation, coherence = np.hstack(found)[:, lines]
    frequency = centre.real / (len(drive) * sample_period)
    return FrequencyResponse(frequency, response, deviation.real, coherence.real)


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
    found = [np.sqrt(np.mean(size[bins] ** 2, axis=1)) for bins in _windows(samples)]
    return np.concatenate([np.zeros(0), *found])


def _turn(samples: int) -> Complex:
    """Delay by a sample, (bins,)."""
    return np.asarray(np.exp(-2j * np.pi * np.arange(samples // 2 + 1) / samples))


def transform(signal: Array) -> Complex:
    """Transform by way of the differences, so that the jump from end to start leaks nothing."""
    differences = np.fft.rfft(np.diff(signal, prepend=signal[0]))
    differences[1:] /= 1.0 - _turn(len(signal))[1:]
    differences[0] = 0.0
    return np.asarray(differences)


def _local(given: Complex, got: Complex) -> tuple[Complex, Array, Array]:
    """Response, its deviation and coherence, (lines,)."""
    columns = _polynomials(given)
    solution = np.linalg.pinv(columns)
    found = solution @ got[:, :, np.newaxis]
    residual = got - (columns @ found)[:, :, 0]
    variance = np.sum(np.abs(residual) ** 2, axis=1) / (columns.shape[1] - columns.shape[2])
    deviation = np.sqrt(variance * np.sum(np.abs(solution[:, 0]) ** 2, axis=1))
    coherence = 1.0 - variance / np.mean(np.abs(got) ** 2, axis=1)
    return found[:, 0, 0], deviation, np.maximum(coherence, 0.0)


def _polynomials(given: Complex) -> Complex:
    """Columns (lines, bins, 2 DEGREE + 2): an input (lines, bins) and 1, each by powers."""
    along = np.linspace(-1.0, 1.0, given.shape[1])[:, np.newaxis] ** np.arange(DEGREE + 1)
    size = np.sqrt(np.mean(np.abs(given) ** 2, axis=1))[:, np.newaxis, np.newaxis]
    leak = np.where(size > 0.0, size, 1.0) * along
    return np.concatenate([given[:, :, np.newaxis] * along, leak], axis=2)
