"""Band rms and band weighting of a signal by the cosine transform.

The cosine transform takes a record as followed by its mirror image, so that drift and creep do
not leak over all frequencies. Coefficient k of n belongs to k / (2 n T) Hz; the transform is
orthonormal, so squares add up (Parseval).
"""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import dct, idct, next_fast_len

from afm_scan_ros.core.types import Array


def bounds(edges: ArrayLike, count: int, sample_period: float) -> tuple[int, ...]:
    """First coefficient of each band between edges (Hz), and the end; an edge is in the upper."""
    inner, duration = np.asarray(edges, dtype=np.float64)[1:-1], 2.0 * count * sample_period
    first = np.ceil(inner * duration * (1.0 - 1e-12))
    return (0, *(int(k) for k in np.minimum(first, count)), count)


def spread(per_band: Array, edges: ArrayLike, count: int, sample_period: float) -> Array:
    """Values of n bands between edges (Hz), for each of ``count`` coefficients; the mean gets 0."""
    values = np.repeat(per_band, np.diff(bounds(edges, count, sample_period)))
    values[0] = 0.0
    return values


def fast_length(count: int) -> int:
    """Largest length up to ``count`` that transforms fast: others take ten times as long."""
    return next(n for n in range(count, 0, -1) if next_fast_len(n, real=True) == n)


def weighted(signal: Array, weights: Array) -> Array:
    """Signal (n,) with its coefficients multiplied by ``weights`` (n,)."""
    coefficients = dct(signal, norm="ortho")
    coefficients *= weights
    return np.asarray(idct(coefficients, norm="ortho", overwrite_x=True))


def coefficients(signals: Array) -> Array:
    """Coefficients (m, n) of signals (m, n), without the mean; squares add to the mean square."""
    found = dct(signals, norm="ortho") / np.sqrt(signals.shape[1])
    found[:, 0] = 0.0
    return np.asarray(found)


def rms_by_band(signal: Array, edges: ArrayLike, sample_period: float) -> Array:
    """Rms of a signal in each of n bands between n + 1 edges (Hz), its mean left out; (n,)."""
    power = dct(signal, norm="ortho") ** 2 / len(signal)
    power[0] = 0.0
    bands = pairwise(bounds(edges, len(signal), sample_period))
    return np.sqrt([power[first:last].sum() for first, last in bands])
