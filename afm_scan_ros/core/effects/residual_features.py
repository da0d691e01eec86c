"""Features of a residual, from which fits of candidate effects start."""

import numpy as np
import scipy
from attrs import frozen

from afm_scan_ros.core.types import Array

STANDS_OUT = 6.0
"""Times the median of its neighbourhood, in amplitude."""
NEIGHBOURHOOD = 101  # lines
MOST = 4


@frozen(eq=False)
class ResidualFeatures:
    """Features of one axis of one record.

    ``drive`` (V), measured ``displacement`` and ``residual`` (m) have shape (n,), as has ``other``,
    the other axis' displacement (m). ``sample_period`` is in s. ``prominent`` are the frequencies
    (Hz) of the residual's largest spectral lines, see ``prominent_lines``.
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
