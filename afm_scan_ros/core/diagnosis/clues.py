"""What is seen of a residual before any candidate is fitted: where to begin."""

import numpy as np
import scipy
from attrs import frozen

from afm_scan_ros.core.types import Array

STANDS_OUT = 6.0
"""Times the median of its neighbourhood, in amplitude."""
NEIGHBOURHOOD = 101  # lines
MOST = 4


@frozen(eq=False)
class Clues:
    """Of one axis of one record: ``drive`` (V), ``displacement`` and ``residual`` (m), all (n,).

    ``other`` (n,) is the other axis' displacement (m).
    ``sample_period`` in s. ``prominent`` are the frequencies (Hz) of the residual's largest lines
    that stand out of their neighbourhood, the largest first.
    """

    sample_period: float
    drive: Array
    displacement: Array
    residual: Array
    other: Array
    prominent: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return len(self.residual) * self.sample_period


def prominent_lines(
    signal: Array, sample_period: float, most: int | None = MOST
) -> tuple[float, ...]:
    """Frequencies (Hz) of the lines of a signal (n,) that stand out, the largest first."""
    size = np.abs(np.fft.rfft(signal * scipy.signal.windows.hann(len(signal), sym=False)))
    inner = size[1:-1]
    peaks = (inner > size[:-2]) & (inner >= size[2:])
    loud = inner > STANDS_OUT * scipy.ndimage.median_filter(inner, NEIGHBOURHOOD, mode="nearest")
    found = 1 + np.flatnonzero(peaks & loud)
    largest = found[np.argsort(size[found])[::-1][:most]]
    return tuple(float(k / (len(signal) * sample_period)) for k in largest)
