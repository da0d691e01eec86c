"""Convolution with one kernel, of blocks and of whole records alike, by overlap-save.

Equation: A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, ch. 8: of a cyclic
convolution of a segment, all but the first samples are those of the linear one. Segments of some
kernels' length lie in a processor's cache, which the transform of a whole record does not; the
kernel's own transform is kept.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from afm_scan_ros.core.types import Array

LENGTHS, SAMPLES = 10, 2**13
"""Of the kernel, or samples, that a segment is long at most: longer ones would leave the cache."""
ROWS = 4
"""Segments transformed together."""
LONGER = 1.1
"""Times as long as needed, that a power of two may be."""
KEPT = 16
"""Transforms of the kernel kept: a stream's blocks have few sizes."""


class Convolution:
    """Filter by a kernel of shape (taps,)."""

    def __init__(self, kernel: Array) -> None:
        self._kernel = kernel
        self._spectrum = lru_cache(KEPT)(self._transformed)

    def valid(self, signal: Array) -> Array:
        """Sums that the whole kernel takes part in: (n - taps + 1,) for a signal (n,), or none."""
        lost = len(self._kernel) - 1
        count = max(len(signal) - lost, 0)
        segments = -(-count // max(LENGTHS * len(self._kernel), SAMPLES))
        if not count:
            return np.empty(0)
        size = _fast(-(-count // segments) + lost)
        step = size - lost
        padded = np.zeros(segments * step + lost)
        padded[: len(signal)] = signal
        if segments == 1:
            return self._cyclic(padded)[:count]
        rows = np.ndarray((segments, size), buffer=padded, strides=(8 * step, 8))
        result = np.empty((segments, step))
        for first in range(0, segments, ROWS):
            part = slice(first, first + ROWS)
            result[part] = self._cyclic(rows[part])
        return result.ravel()[:count]

    def _cyclic(self, segments: Array) -> Array:
        """Cyclic convolution of each segment (…, size), without the samples it spoils."""
        size = segments.shape[-1]
        spectra = fft.rfft(segments)
        spectra *= self._spectrum(size)
        whole = fft.irfft(spectra, size, overwrite_x=True)
        return np.asarray(whole[..., len(self._kernel) - 1 :])

    def _transformed(self, size: int) -> NDArray[np.complex128]:
        return np.asarray(fft.rfft(self._kernel, size))


def _fast(least: int) -> int:
    """Length of a transform; a power of two is the fastest, though it be somewhat longer."""
    power = 1 << (least - 1).bit_length()
    return power if power <= LONGER * least else int(fft.next_fast_len(least, real=True))
