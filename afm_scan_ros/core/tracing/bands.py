"""A signal by bands of frequency, without a jump where its end meets its start.

The cosine transform takes a record as followed by its mirror image, so that drift and creep do
not leak over all frequencies. Coefficient k of n belongs to k / (2 n T) Hz; the transform is
orthonormal, so squares add up (Parseval).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import dct, idct, next_fast_len

from afm_scan_ros.core.types import Array


def spread(per_band: Array, edges: ArrayLike, count: int, sample_period: float) -> Array:
    """Values of n bands between n + 1 edges (Hz), for each of ``count`` coefficients; 0 at rest.

    The first coefficient, the signal's mean, gets 0: displacement is relative.
    """
    frequency = np.arange(count) / (2.0 * count * sample_period)
    band = np.clip(np.searchsorted(edges, frequency, "right") - 1, 0, len(per_band) - 1)
    values = np.asarray(per_band)[band]
    values[0] = 0.0
    return values


def fast_length(count: int) -> int:
    """Largest length up to ``count`` that transforms fast: others take ten times as long."""
    return next(n for n in range(count, 0, -1) if next_fast_len(n, real=True) == n)


def weighted(signal: Array, weights: Array) -> Array:
    """Signal (n,) with its coefficients multiplied by ``weights`` (n,)."""
    return np.asarray(idct(weights * dct(signal, norm="ortho"), norm="ortho"))


def rms_by_band(signal: Array, edges: ArrayLike, sample_period: float) -> Array:
    """Rms of a signal in each of n bands between n + 1 edges (Hz), its mean left out; (n,)."""
    power = dct(signal, norm="ortho") ** 2 / len(signal)
    bands = [spread(row, edges, len(signal), sample_period) for row in np.eye(np.size(edges) - 1)]
    return np.asarray(np.sqrt([power @ band for band in bands]))
