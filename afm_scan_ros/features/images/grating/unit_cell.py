"""The mean unit cell of a grating: its height as a periodic function, averaged over all cells."""

import numpy as np
from attrs import frozen
from scipy.ndimage import map_coordinates, spline_filter

from afm_scan_ros.core.types import Array

CUBIC = 3
PERIODIC = "grid-wrap"


@frozen(eq=False)
class UnitCell:
    """Heights (size, size) on a periodic grid of the cell's two coordinates, and their splines."""

    heights: Array
    _spline: Array
    _slopes: tuple[Array, Array]

    @classmethod
    def of(cls, heights: Array) -> "UnitCell":
        """Interpolate heights on the grid, and their slopes, by periodic splines."""
        size = len(heights)
        spectrum = np.fft.fft2(heights)
        waves = 2j * np.pi * np.fft.fftfreq(size, 1.0 / size)
        waves[size // 2] = 0.0  # the line at the highest frequency has no sign
        slopes = (
            np.fft.ifft2(spectrum * waves[:, np.newaxis]).real,
            np.fft.ifft2(spectrum * waves).real,
        )
        first, second = (spline_filter(each, CUBIC, mode=PERIODIC) for each in slopes)
        return cls(heights, spline_filter(heights, CUBIC, mode=PERIODIC), (first, second))

    def height(self, u: Array, v: Array) -> Array:
        """Height at coordinates in cells, of one shape."""
        return self._at(self._spline, u, v)

    def slopes(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Change of the height with each coordinate, per cell."""
        return self._at(self._slopes[0], u, v), self._at(self._slopes[1], u, v)

    @property
    def border(self) -> Array:
        """Coordinates (2,) between features: there the slopes along the other one are least."""
        places = np.linspace(0.0, 1.0, len(self.heights), endpoint=False)
        slopes = self.slopes(*np.meshgrid(places, places, indexing="ij"))
        steepness = slopes[0] ** 2 + slopes[1] ** 2
        return np.array([places[steepness.sum(axis=1 - k).argmin()] for k in range(2)])

    def _at(self, spline: Array, u: Array, v: Array) -> Array:
        size = len(self.heights)
        places = np.stack([(u % 1.0) * size, (v % 1.0) * size])
        return np.asarray(
            map_coordinates(spline, places, order=CUBIC, mode=PERIODIC, prefilter=False)
        )


def mean_cell(u: Array, v: Array, heights: Array, weights: Array, size: int) -> UnitCell:
    """Weighted mean of heights (n,) at coordinates in cells (n,), on a grid of ``size`` a side.

    Each height is shared by the four nearest points; points that none is near take the mean of
    those around them.
    """
    total, weight = np.zeros(size * size), np.zeros(size * size)
    row, column = (u % 1.0) * size, (v % 1.0) * size
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    down, right = row - i, column - j
    corners = (((1 - down), 0), (down, 1)), (((1 - right), 0), (right, 1))
    for share_i, step_i in corners[0]:
        for share_j, step_j in corners[1]:
            index = ((i + step_i) % size) * size + (j + step_j) % size
            share = share_i * share_j * weights
            total += np.bincount(index, share * heights, size * size)
            weight += np.bincount(index, share, size * size)
    return UnitCell.of(_filled(total.reshape(size, size), weight.reshape(size, size)))


def _filled(total: Array, weight: Array) -> Array:
    """Mean at each point; an empty one takes that of a neighbourhood that is not."""
    while not np.all(weight > 0.0):
        near_total = sum(np.roll(total, step, axis) for step in (-1, 1) for axis in (0, 1))
        near_weight = sum(np.roll(weight, step, axis) for step in (-1, 1) for axis in (0, 1))
        empty = weight <= 0.0
        total, weight = np.where(empty, near_total, total), np.where(empty, near_weight, weight)
    return np.asarray(total / weight)
