"""Convolution with one kernel, of blocks and of whole records alike, by overlap-save.

Equation: A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, ch. 8: of a cyclic
convolution of a segment, all but the first samples are those of the linear one. Segments of some
kernels' length lie in a processor's cache, which the transform of a whole record does not; the
kernel's own transform is kept.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from afm_scan_ros.core.types import Array

Spectrum = NDArray[np.complex128]

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
        self.taps = len(kernel)
        self._spectrum: Callable[[int], Spectrum] = lru_cache(KEPT)(partial(fft.rfft, kernel))

    def valid(self, signal: Array) -> Array:
        """Sums that the whole kernel takes part in: (n - taps + 1,) for a signal (n,), or none."""
        lost = self.taps - 1
        count = max(len(signal) - lost, 0)
        segments = -(-count // max(LENGTHS * self.taps, SAMPLES))
        if not count:
            return np.empty(0)
        size = _fast(-(-count // segments) + lost)
        step = size - lost
        padded = np.zeros(segments * step + lost)
        padded[: len(signal)] = signal
        rows = np.ndarray((segments, size), buffer=padded, strides=(8 * step, 8))
        result = np.empty((segments, step))
        for first in range(0, segments, ROWS):
            part = slice(first, first + ROWS)
            result[part] = _cyclic(rows[part], self._spectrum(size))[:, lost:]
        return result.ravel()[:count]


class SideBySide:
    """Filter several streams, each by its own of the kernels of shape (streams, taps).

    The state is the run of samples still needed, shape (streams, n). Blocks that are short become
    the rows of one transform, which takes less time than one for each.
    """

    def __init__(self, kernels: Array) -> None:
        self.count, self.taps = kernels.shape
        self._each = [Convolution(kernel) for kernel in kernels]
        self._spectra: Callable[[int], Spectrum] = lru_cache(KEPT)(partial(fft.rfft, kernels))

    def filter(self, state: Array, blocks: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Return the state after each stream's next block, of one length, and what is valid."""
        begin, lost = state.shape[1], self.taps - 1
        length = begin + len(blocks[0])
        rows = np.zeros((len(blocks), _fast(max(length, 1))))
        rows[:, :begin] = state
        for row, block in zip(rows, blocks, strict=True):
            row[begin:length] = block
        after = rows[:, max(length - lost, 0) : length].copy()
        if rows.shape[1] > SAMPLES:
            return after, [e.valid(row[:length]) for e, row in zip(self._each, rows, strict=True)]
        return after, list(_cyclic(rows, self._spectra(rows.shape[1]))[:, lost:length])


def _cyclic(rows: Array, spectra: Spectrum) -> Array:
    """Cyclic convolution of each row, shape (rows, size), with the kernels of the spectra."""
    products = fft.rfft(rows)
    products *= spectra
    return np.asarray(fft.irfft(products, rows.shape[-1], overwrite_x=True))


def _fast(least: int) -> int:
    """Length of a transform; a power of two is the fastest, though it be somewhat longer."""
    power = 1 << (least - 1).bit_length()
    return power if power <= LONGER * least else int(fft.next_fast_len(least, real=True))
