"""What explains an image of a grating: where the scanner was at each pixel, and the mean cell.

The former are smooth functions of pixel and line:

    position(pixel, line) = f(pixel) + g(line) + b pixel line

``f`` is another function for trace and retrace, ``g`` is common to both. A line repeats the motion
of the one before it, so what changes from line to line is the slow axis, creep, drift and what
one axis adds to the other. Functions are cubic splines; the coefficients enter linearly. A fast
line rings after each turn: f then has a damped oscillation as well. Its amplitude and phase, and
how they change along the line, are coefficients of each direction.
"""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from attrs import frozen
from scipy.interpolate import BSpline, RectBivariateSpline
from scipy.ndimage import map_coordinates, spline_filter

from afm_scan_ros.core.types import Array

CUBIC = 3
AT_TURN = 9
"""Places of the half of a line to which a parabola is fitted."""
HALF = 0.5
"""Greatest distance of a ripple's amplitude from that of a mode, over the latter."""
COARSE = 33
"""Lines and pixels of the grid on which a motion's uncertainty is computed."""


def spline_basis(places: Array, intervals: int) -> Array:
    """Cubic B-splines over -1 to 1 at places (n,): (n, intervals + 3). Their sum is one.

    All knots are evenly spaced, so that a parabola has no third differences.
    """
    knots = 2.0 * np.arange(-CUBIC, intervals + CUBIC + 1) / intervals - 1.0
    return np.asarray(BSpline.design_matrix(np.clip(places, -1.0, 1.0), knots, CUBIC).toarray())


def middles(count: int) -> Array:
    """Middles of so many pixels (or lines), over half the image, from -1 to 1."""
    return (2.0 * np.arange(count) + 1.0) / count - 1.0


def since_turn(direction: int, pixels: Array) -> Array:
    """Time since a line began, over that of a line one way, at pixels from -1 to 1: (n,)."""
    return np.asarray(0.5 * (1.0 - pixels if direction else 1.0 + pixels))


@frozen
class Ripple:
    """A damped oscillation after each turn: its ``periods`` in a line one way, and ``damping``."""

    COLUMNS: ClassVar[int] = 4

    periods: float
    damping: float

    @property
    def pole(self) -> complex:
        """Pole, in units of the time of a line one way."""
        return complex(2.0 * np.pi * self.periods * (1j - self.damping))

    def behind_a_triangle(self, overscan: float) -> complex:
        """Amplitude at the beginning of a line of length 1 of a mode that follows a triangle.

        The speed turns round, so the mode rings by twice the speed over its angular frequency. What
        earlier turns left has the other sign each time.
        """
        rings = 1j / (np.pi * self.periods) * np.exp(self.pole * overscan)
        return complex(rings / (1.0 + np.exp(self.pole * (1.0 + 2.0 * overscan))))

    def columns(self, passed: Array) -> Array:
        """Oscillation, and times it, at times from 0 to 1 over a line (n,): (n, 4).

        The latter are its change with the pole.
        """
        decay = np.exp(self.pole * passed)
        return np.stack([decay.real, decay.imag, passed * decay.real, passed * decay.imag], axis=1)


@frozen
class MotionForm:
    """Numbers of an image's motion: its ``lines``, ``pixels``, and the intervals of the splines.

    ``pixel_intervals`` are those of f, ``line_intervals`` those of g. A line goes on by
    ``overscan`` of its length at either end before it turns. f has a ``ripple`` or none.
    """

    lines: int
    pixels: int
    pixel_intervals: int
    line_intervals: int
    overscan: float = 0.0
    ripple: Ripple | None = None

    @property
    def splines(self) -> int:
        """Splines of f in one direction: its first coefficients."""
        return self.pixel_intervals + CUBIC

    @property
    def fast(self) -> int:
        """Coefficients of f in one direction."""
        return self.splines + (0 if self.ripple is None else Ripple.COLUMNS)

    @property
    def slow(self) -> int:
        """Coefficients of g, whose last one is left out, as f holds the constant."""
        return self.line_intervals + CUBIC - 1

    @property
    def count(self) -> int:
        """Coefficients of one coordinate: f of the trace, f of the retrace, g and b."""
        return 2 * self.fast + self.slow + 1

    def along(self, direction: int, pixels: Array) -> Array:
        """Factors of f's coefficients at pixels (n,), from -1 to 1: (n, fast).

        ``direction`` is 0 for the trace, which runs to higher pixels, 1 for the retrace.
        """
        smooth = spline_basis(pixels, self.pixel_intervals)
        if self.ripple is None:
            return smooth
        return np.hstack([smooth, self.ripple.columns(since_turn(direction, pixels))])

    def part(self, direction: int) -> slice:
        """Coefficients of f in a direction."""
        return slice(direction * self.fast, (direction + 1) * self.fast)

    def smooth_part(self, direction: int) -> slice:
        """Coefficients of f's splines in a direction."""
        return slice(direction * self.fast, direction * self.fast + self.splines)

    def across(self, lines: Array) -> Array:
        """Values of g's splines at lines (n,), from -1 to 1: (n, slow)."""
        return spline_basis(lines, self.line_intervals)[:, :-1]

    def rows(self, direction: int, lines: Array, pixels: Array) -> Array:
        """Factors of the coefficients at places (n,) from -1 to 1: (n, count)."""
        result = np.zeros((len(lines), self.count))
        result[:, self.part(direction)] = self.along(direction, pixels)
        result[:, 2 * self.fast : -1] = self.across(lines)
        result[:, -1] = lines * pixels
        return result

    def image(self, direction: int, coefficients: Array) -> Array:
        """Positions at all pixels of a direction: (lines, pixels), or with a last axis of many.

        ``coefficients`` are (count,) or (count, many).
        """
        pixels, lines = middles(self.pixels), middles(self.lines)
        fast = self.along(direction, pixels) @ coefficients[self.part(direction)]
        slow = self.across(lines) @ coefficients[2 * self.fast : -1]
        both = np.multiply.outer(np.multiply.outer(lines, pixels), coefficients[-1])
        return np.asarray(fast[np.newaxis] + slow[:, np.newaxis] + both)

    def turns(self) -> Array:
        """Factors of trace less retrace at the turns before and behind the line: (2, count).

        A parabola is fitted to the half of the line next to a turn, without ripple. It is
        extrapolated through the overscan.
        """
        result = np.zeros((2, self.count))
        for end, row in zip((-1.0, 1.0), result, strict=True):
            pixels = end * np.linspace(0.5, 1.0, AT_TURN)
            parabolas = np.linalg.pinv(np.vander(pixels, 3))
            at_turn = np.vander([end * (1.0 + 2.0 * self.overscan)], 3)[0] @ parabolas
            apart = at_turn @ spline_basis(pixels, self.pixel_intervals)
            row[self.smooth_part(0)], row[self.smooth_part(1)] = apart, -apart
        return result

    def rings_as_a_mode(self, coefficients: Array) -> bool:
        """Whether the ripple's amplitude is that of a mode behind a triangle, within half of it.

        The amplitude is complex, the mean of both directions. Hysteresis slows the motion after a
        turn, so it is less than that of a mode alone. ``coefficients`` are (count, 2).
        """
        if self.ripple is None:
            return False
        shares = []
        for direction, sign in enumerate((1.0, -1.0)):
            first = self.smooth_part(direction).stop
            line = np.diff(self.image(direction, coefficients)[:, [0, -1]], axis=1).mean(axis=0)[0]
            real, imaginary = coefficients[first : first + 2] @ line / (line @ line)
            shares.append(sign * complex(real, -imaginary))
        share = complex(np.mean(shares)) / self.ripple.behind_a_triangle(self.overscan)
        return abs(share - 1.0) < HALF

    def with_retrace_shifted(self, coefficients: Array, distance: Array) -> Array:
        """Coefficients (count, many) whose retrace is shifted by a distance (many,)."""
        moved = coefficients.copy()
        moved[self.smooth_part(1)] += distance
        return moved

    def coarse(self, direction: int) -> Array:
        """Factors of the coefficients at a coarse grid over the image: (COARSE**2, count)."""
        line, pixel = np.meshgrid(middles(COARSE), middles(COARSE), indexing="ij")
        return self.rows(direction, line.ravel(), pixel.ravel())

    def variances(self, direction: int, covariance: Array) -> Array:
        """Variances of both coordinates at the coarse grid: (COARSE**2, 2).

        ``covariance`` (2 count, 2 count) is that of the coefficients of one, then of the other.
        """
        rows = self.coarse(direction)
        blocks = covariance[: self.count, : self.count], covariance[self.count :, self.count :]
        return np.stack([np.einsum("ij,ij->i", rows @ each, rows) for each in blocks], axis=1)

    def deviation(self, direction: int, covariance: Array) -> Array:
        """Standard deviation of the less certain coordinate at all pixels: (lines, pixels)."""
        largest = np.sqrt(self.variances(direction, covariance).max(axis=1))
        grid = middles(COARSE)
        between = RectBivariateSpline(grid, grid, largest.reshape(COARSE, COARSE), kx=1, ky=1)
        return np.asarray(between(middles(self.lines), middles(self.pixels)))

    def roughness(self) -> tuple[Array, Array]:
        """Third differences of f's splines, and of g's: (rows, count) each."""
        count = self.count
        trace, retrace = np.zeros((2, self.splines - CUBIC, count))
        steps = np.diff(np.eye(self.splines), CUBIC, axis=0)
        trace[:, self.smooth_part(0)] = retrace[:, self.smooth_part(1)] = steps
        slow = np.zeros((self.slow + 1 - CUBIC, count))
        slow[:, 2 * self.fast : -1] = np.diff(np.eye(self.slow + 1), CUBIC, axis=0)[:, :-1]
        return np.vstack([trace, retrace]), slow


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


def mean_cell(
    form: MotionForm,
    coefficients: Array,
    heights: Sequence[Array],
    weights: Sequence[Array],
    size: int,
) -> UnitCell:
    """Weighted mean of the heights of each direction at a motion, on a grid of ``size`` a side.

    Each height is shared by the four nearest points; points that none is near take the mean of
    those around them.
    """
    total, weight = np.zeros(size * size), np.zeros(size * size)
    where = [
        form.image(direction, coefficients).reshape(-1, 2) for direction in range(len(heights))
    ]
    row, column = (np.concatenate(where).T % 1.0) * size
    seen, counted = (np.concatenate([each.ravel() for each in v]) for v in (heights, weights))
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    down, right = row - i, column - j
    corners = (((1 - down), 0), (down, 1)), (((1 - right), 0), (right, 1))
    for share_i, step_i in corners[0]:
        for share_j, step_j in corners[1]:
            index = ((i + step_i) % size) * size + (j + step_j) % size
            share = share_i * share_j * counted
            total += np.bincount(index, share * seen, size * size)
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
