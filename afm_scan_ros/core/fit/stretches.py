"""Stretches of a record over which it is so smooth that one row of derivatives stands for them.

A signal is smooth at a scale where means over 2n samples foretell those over n. With the means m_k,
the half of the difference of both halves of stretch k is that of the quintic through the means,

    p_k = (22 (m_{k-1} - m_{k+1}) - 3 (m_{k-2} - m_{k+2})) / 128,

and the detail, what p_k misses, is that of the biorthogonal wavelet (1, 5). Of white noise of the
variance σ² a sample it has the variance (1/2 + (22² + 3²) / 128²) σ² / n.
Source: A. Cohen, I. Daubechies and J.-C. Feauveau, Comm. Pure Appl. Math. 45 (1992) 485, table 6.1.
"""

from collections.abc import Iterator

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.types import Array

Edges = NDArray[np.intp]
"""Where each stretch begins, and where the last one ends, (stretches + 1,)."""

FORETOLD = np.array([-3.0, 22.0, 0.0, -22.0, 3.0]) / 128.0
"""Weights of m_{k-2} to m_{k+2} in p_k."""


def averaged(signal: Array, block: int) -> Array:
    """Means over blocks, shape (blocks, …)."""
    count = len(signal) // block
    return np.asarray(signal[: count * block].reshape(count, block, *signal.shape[1:]).mean(axis=1))


def means(signal: Array, edges: Edges) -> Array:
    """Means over stretches, shape (stretches, …)."""
    lengths = np.diff(edges).reshape(-1, *[1] * (signal.ndim - 1))
    return np.asarray(np.add.reduceat(signal[: edges[-1]], edges[:-1]) / lengths)


def smooth_edges(
    drive: Array,
    displacement: Array,
    noise: float,
    half_range: float,
    first: int,
    settings: FitSettings,
) -> Edges:
    """Edges of the longest stretches, of powers of two, over which both signals are smooth.

    Both have the shape (n,); ``noise`` is the standard deviation of the displacement (m),
    ``half_range`` that of the operator (V). Sample ``first`` begins a stretch.
    """
    longest = max(len(drive) // settings.smooth_window, 1).bit_length()
    least, most = settings.bend * float(np.std(drive)), settings.smooth_move * half_range
    test = _Smoothness(drive, displacement, noise, least, most, settings)
    parts = (0, first), (first, len(drive))
    found = [edge for part in parts for edge in test.split(*part, 1 << longest)]
    return np.array([*found, len(drive)], np.intp)


@frozen(eq=False)
class _Smoothness:
    """A test of signals, of which the drive's details may have a ``least`` size (V).

    Within a stretch the drive moves by ``most`` (V) at most.
    """

    drive: Array
    displacement: Array
    noise: float
    least: float
    most: float
    settings: FitSettings

    def split(self, first: int, last: int, length: int) -> Iterator[int]:
        """Yield where stretches of a length begin, or of half of it where they are not smooth."""
        window = self.settings.smooth_window * length
        for start in range(first, last, window):
            end = min(start + window, last)
            if length == 1 or (end == start + window and self._holds(start, end, length)):
                yield from range(start, end, length)
            else:
                yield from self.split(start, end, length // 2)

    def _holds(self, start: int, end: int, length: int) -> bool:
        """Whether means foretell both signals, of all lengths, and also for some time before.

        A sine that is faster than a length does not show in means over it.
        """
        settings, half = self.settings, length // 2
        if np.ptp(self.drive[start:end].reshape(-1, length), axis=1).max() > self.most:
            return False
        before = half * min(2 * settings.smooth_age, start // half)
        near = slice(start - before, min(end + 4 * half, len(self.drive)))
        drive, displacement = self.drive[near], self.displacement[near]
        least = (settings.smooth_drive * np.std(drive)) ** 2 + self.least**2
        samples, white = 1, 0.5 + 0.5 * float(FORETOLD @ FORETOLD)
        while samples < length:
            moved, driven = (np.mean(_details(one) ** 2) for one in (displacement, drive))
            uncertain = settings.smooth_sigma * np.sqrt(4.0 / len(drive))
            if moved > (1.0 + uncertain) * white * self.noise**2 / samples or driven > least:
                return False
            drive, displacement = averaged(drive, 2), averaged(displacement, 2)
            samples *= 2
        return True


def _details(signal: Array) -> Array:
    """Half the difference of both halves of each pair, less what the means foretell of it."""
    pairs = signal[: len(signal) // 2 * 2].reshape(-1, 2)
    mean, half = pairs.mean(axis=1), 0.5 * (pairs[:, 0] - pairs[:, 1])
    return np.asarray(half[2:-2] - np.correlate(mean, FORETOLD, "valid"))
