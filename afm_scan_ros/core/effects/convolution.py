"""Convolution with one kernel, of blocks and of whole records alike, by overlap-save.

Equation: A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, ch. 8: of a cyclic
convolution of a segment, all but the first samples are those of the linear one. Segments of some
kernels' length lie in a processor's cache, which the transform of a whole record does not; the
kernel's own transform is kept.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial
from itertools import repeat

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
        self.spectrum: Callable[[int], Spectrum] = lru_cache(KEPT)(partial(fft.rfft, kernel))
        """The kernel's transform at a length of at least ``taps``."""

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
            result[part] = _cyclic(rows[part], repeat(self.spectrum(size)))[:, lost:]
        return result.ravel()[:count]


def stream_together(
    convolutions: Sequence[Convolution], states: Sequence[Array], blocks: Sequence[Array]
) -> tuple[list[Array], list[Array]]:
    """Filter a stream's next block by each convolution; return the states after, and the results.

    A state is the run of samples still needed. Blocks that are short become the rows of one
    transform, which takes less time than one for each.
    """
    parts = list(zip(states, blocks, strict=True))
    lengths = [len(state) + len(block) for state, block in parts]
    size = _fast(max(1, *lengths))
    rows = np.zeros((len(parts), size))
    joined = [
        np.concatenate(part, out=row[:length])
        for part, row, length in zip(parts, rows, lengths, strict=True)
    ]
    if size > SAMPLES:
        results = [each.valid(signal) for each, signal in zip(convolutions, joined, strict=True)]
    else:
        wholes = _cyclic(rows, [each.spectrum(size) for each in convolutions])
        results = [
            whole[each.taps - 1 : length]
            for each, whole, length in zip(convolutions, wholes, lengths, strict=True)
        ]
    return [s[len(new) :].copy() for s, new in zip(joined, results, strict=True)], results


def _cyclic(rows: Array, spectra: Iterable[Spectrum]) -> Array:
    """Cyclic convolution of each row, shape (rows, size), with the kernel of its spectrum."""
    products = fft.rfft(rows)
    for product, spectrum in zip(products, spectra, strict=False):
        np.multiply(product, spectrum, out=product)
    return np.asarray(fft.irfft(products, rows.shape[-1], overwrite_x=True))


def _fast(least: int) -> int:
    """Length of a transform; a power of two is the fastest, though it be somewhat longer."""
    power = 1 << (least - 1).bit_length()
    return power if power <= LONGER * least else int(fft.next_fast_len(least, real=True))
