"""The cells of a grating in an image, found by their likeness and numbered along the lattice."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.signal import fftconvolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

WITHOUT_DUST = (0.03, 0.97)
"""Quantiles of the heights beyond which particles and spikes lie, and little of the cells."""
FARTHEST = 1.6
"""Distance of neighbouring cells over the nominal pitch, up to which they are sought."""
SQUARE = np.sin(np.pi / 3.0)
"""Least sine of the angle between two lattice vectors."""
ALIKE = 0.5
"""Least share of the highest peak that another one of a lattice has."""
NEGATIVE = 0.75
"""Least negative correlation of shifts by half a cell, over that of a whole one.

It is midway between a half, of discs that nearly touch, and one, of a chessboard.
"""
DIAGONAL = float(np.sqrt(0.5))
"""Side of a square over its diagonal."""
TRUSTED = -np.log(DIAGONAL) / 3.0
"""Logarithm of period over pitch up to which a reading is taken: a third of that between both."""
LEVELS = float(np.sqrt(np.pi**2 / 8.0))
"""Rms over mean magnitude, midway between 1, of two levels, and that of a sum of two sines."""
STARTS = 5
"""Cells from which a walk is begun in turn, as one may be damaged."""
LIKE = 0.5
"""Least correlation of a cell with the one in the middle: more than half of it is explained."""
AWAY = 0.3
"""Share of the lattice vector within which a neighbour may lie from where it is expected."""
FEWEST = 6
"""Cells from which a motion of two parabolas, of five numbers, can be found and checked."""


@frozen(eq=False)
class Cells:
    """Cells found in one image: numbers along the lattice (n, 2), and places (n, 2).

    A place is (line, pixel), in pixels from the middle of the first one.
    """

    numbers: NDArray[np.int64]
    places: Array

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def show_bending(self) -> bool:
        """Whether they show how both directions bend: three numbers along each, or more."""
        return all(len(np.unique(numbers)) > 2 for numbers in self.numbers.T)  # noqa: PLR2004


def levelled(heights: Array) -> Array:
    """Heights (lines, pixels) without a parabola in both directions."""
    rows, columns = heights.shape
    row, column = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    terms = [np.ones_like(row), row, column, row * column, row**2, column**2]
    basis = np.stack([term.ravel() for term in terms], axis=1)
    below = basis @ np.linalg.lstsq(basis, heights.ravel(), rcond=None)[0]
    return np.asarray(heights - below.reshape(heights.shape))


@frozen(eq=False)
class Lattice:
    """The lattice of the shortest ``vectors`` (2, 2), rows (lines, pixels).

    The first vector runs along the lines most, the second ahead of it. ``period`` is their length
    over the nominal pitch. ``negative`` is whether the middles of the cells show the negative of
    their corners: then the pitch is the diagonal of a cell, as of a chessboard, whose heights have
    ``two_levels``, or its side, as of a sum of two sines.
    """

    vectors: Array
    period: float
    negative: bool
    two_levels: bool

    @property
    def share(self) -> float:
        """Distance of neighbouring cells over the pitch: of two the one near the period, if any.

        Otherwise the heights decide.
        """
        if not self.negative:
            return 1.0
        for share in (1.0, DIAGONAL):
            if abs(np.log(self.period / share)) < TRUSTED:
                return share
        return DIAGONAL if self.two_levels else 1.0


def lattice_of(heights: Array, pitch: tuple[float, float]) -> Lattice:
    """Lattice of levelled heights; ``pitch`` is the nominal one in lines and pixels.

    Among the high peaks of the autocorrelation its vectors are the two shortest about at right
    angles, so that no shorter period is left. Raises InputError where there is no such pair.
    """
    likeness = _autocorrelation(np.clip(heights, *np.quantile(heights, WITHOUT_DUST)))
    middle = np.array(likeness.shape) // 2
    vectors, found = _high_peaks(likeness, pitch)
    relative = vectors / np.array(pitch)
    length = np.hypot(*relative.T)
    pairs = []
    for k, m in combinations(range(len(found)), 2):
        a, b = relative[k], relative[m]
        halves = 0.5 * np.stack([vectors[k] + vectors[m], vectors[k] - vectors[m]])
        between = likeness[tuple((middle + np.rint(halves).astype(int)).T)]
        if between.max() >= ALIKE * min(found[k], found[m]):
            continue
        if abs(a[0] * b[1] - a[1] * b[0]) > SQUARE * length[k] * length[m]:
            negative = between.max() < -NEGATIVE * max(found[k], found[m])
            pairs.append((length[k] * length[m], k, m, negative))
    if not pairs:
        raise InputError(
            "no lattice of two directions with about this pitch is in the image: give an image of"
            " a grating that repeats in both directions, and its pitch"
        )
    area, k, m, negative = min(pairs)
    shortest = _ordered(vectors[k].astype(float), vectors[m].astype(float))
    apart = heights - heights.mean()
    two_levels = bool(apart.std() < LEVELS * np.abs(apart).mean())
    return Lattice(shortest, float(np.sqrt(area)), bool(negative), two_levels)


def _high_peaks(likeness: Array, pitch: tuple[float, float]) -> tuple[NDArray[np.int64], Array]:
    """Shifts (n, 2) at which the autocorrelation is high and not halfway, and its values (n,).

    Each is the highest one within a third of its own length, so that none is of a cell's own shape.
    """
    middle = np.array(likeness.shape) // 2
    vectors = np.argwhere((likeness == maximum_filter(likeness, size=3)) & (likeness > 0.0))
    vectors = vectors - middle
    length = np.hypot(*(vectors / np.array(pitch)).T)
    vectors = vectors[(length > 0.0) & (length < FARTHEST)]
    found, before, halfway = (
        likeness[tuple((middle + np.rint(share * vectors).astype(int)).T)]
        for share in (1.0, 2.0 / 3.0, 0.5)
    )
    high = found >= ALIKE * np.max(found, where=found > before, initial=0.0)
    high &= (found > before) & (halfway < ALIKE * found)  # lines are alike all along them
    vectors, found = vectors[high], found[high]
    relative = vectors / np.array(pitch)
    apart = np.linalg.norm(relative[:, np.newaxis] - relative, axis=2)
    near = apart < np.linalg.norm(relative, axis=1)[:, np.newaxis] / 3.0
    highest = found >= np.max(np.where(near, found, 0.0), axis=1, initial=0.0)
    return vectors[highest], found[highest]


def _ordered(first: Array, second: Array) -> Array:
    """Order a pair so that the first runs along the lines, and both point to higher numbers."""
    along, across = (first, second) if abs(first[1]) > abs(second[1]) else (second, first)
    along = along * np.sign(along[1])
    return np.stack([along, across * np.sign(across[0] * along[1] - across[1] * along[0])])


def _autocorrelation(heights: Array) -> Array:
    """Autocorrelation over the overlap, for shifts up to half the image, zero in the middle."""
    rows, columns = heights.shape
    size = (2 * rows, 2 * columns)
    centred = heights - heights.mean()
    power = np.abs(np.fft.rfft2(centred, size)) ** 2
    whole = np.fft.fftshift(np.fft.irfft2(power, size))
    part = whole[rows // 2 : rows + rows // 2 + 1, columns // 2 : columns + columns // 2 + 1]
    shifts = [np.abs(np.arange(-(n // 2), n - n // 2 + 1)[: n + 1]) for n in (rows, columns)]
    overlap = np.outer(rows - shifts[0], columns - shifts[1])[: part.shape[0], : part.shape[1]]
    spread = max(float(centred.var()), np.finfo(float).tiny)  # a flat image has none
    return np.asarray(part / overlap / spread)


def cells_of(heights: Sequence[Array], vectors: Array) -> list[Cells]:
    """Cells of the levelled heights of each direction, by their likeness to one of the first.

    Of some cells near the middle of the first direction, that one counts to which most are like.
    The numbers of each direction begin at a cell of its own. Raises InputError where too few are
    found.
    """
    middle = np.array(heights[0].shape) // 2
    around = [np.zeros(2), *vectors, *-vectors][:STARTS]
    best: list[Cells] = []
    for offset in around:
        patch = _patch(heights[0], vectors, middle + offset)
        found = [_most_cells(likeness_to(patch, each), vectors) for each in heights]
        if not best or min(map(len, found)) > min(map(len, best)):
            best = found
    fewest = min(map(len, best))
    if fewest < FEWEST or not all(each.show_bending for each in best):
        raise InputError(
            f"the cells of the grating that were recognised are too few ({fewest}): give an image"
            " of at least three by three whole ones, with less noise"
        )
    return best


def _patch(heights: Array, vectors: Array, place: Array) -> Array:
    """Heights of one cell around a place."""
    half = np.maximum(np.abs(vectors).max(axis=0) // 2, 2).astype(int)
    middle = np.clip(np.rint(place).astype(int), half, np.array(heights.shape) - half - 1)
    low, high = middle - half, middle + half + 1
    return heights[low[0] : high[0], low[1] : high[1]]


def _most_cells(likeness: Array, vectors: Array) -> Cells:
    """Largest set of cells among walks from the most alike places around the middle."""
    third = np.array(likeness.shape) // 3
    inner = likeness[third[0] : -third[0], third[1] : -third[1]].copy()
    reach = np.maximum(np.abs(vectors).max(axis=0) * 0.5, 1.0).astype(int)
    best = Cells(np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2)))
    for _ in range(STARTS):
        top = np.array(np.unravel_index(int(inner.argmax()), inner.shape))
        found = found_cells(likeness, vectors, top + third)
        best = max(best, found, key=len)
        low = np.maximum(top - reach, 0)
        inner[low[0] : top[0] + reach[0] + 1, low[1] : top[1] + reach[1] + 1] = -1.0
    return best


def likeness_to(patch: Array, heights: Array) -> Array:
    """Normalised correlation of a patch with its surroundings at each pixel; -1 at the border."""
    shape = patch.shape
    pattern = patch - patch.mean()
    count = patch.size
    ones = np.ones(shape)
    sums = fftconvolve(heights, ones, mode="valid")
    squares = fftconvolve(heights**2, ones, mode="valid")
    energy = np.maximum(squares - sums**2 / count, 1e-12 * float(np.sum(pattern**2)))
    product = fftconvolve(heights, pattern[::-1, ::-1], mode="valid")
    result = np.full(heights.shape, -1.0)
    half = shape[0] // 2, shape[1] // 2
    inner = product / np.sqrt(energy * np.sum(pattern**2))
    result[half[0] : half[0] + inner.shape[0], half[1] : half[1] + inner.shape[1]] = inner
    return result


def found_cells(likeness: Array, vectors: Array, start: Array) -> Cells:
    """Walk from cell to cell, from the one nearest ``start`` on, as far as they are alike."""
    first = _peak(likeness, start, vectors, AWAY)
    found: dict[tuple[int, int], Array] = {} if first is None else {(0, 0): first}
    waiting, taken = list(found), {_pixel(place) for place in found.values()}
    while waiting:
        here = waiting.pop(0)
        for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            number = (here[0] + step[0], here[1] + step[1])
            if number in found:
                continue
            place = _peak(likeness, found[here] + _ahead(found, here, step, vectors), vectors, AWAY)
            if place is not None and _pixel(place) not in taken:
                found[number] = place
                waiting.append(number)
                taken.add(_pixel(place))
    return Cells(
        np.array(list(found)).reshape(-1, 2), np.array(list(found.values())).reshape(-1, 2)
    )


def _pixel(place: Array) -> tuple[int, int]:
    """Pixel of a place: no two cells have the same."""
    return round(place[0]), round(place[1])


def _ahead(
    found: dict[tuple[int, int], Array],
    here: tuple[int, int],
    step: tuple[int, int],
    vectors: Array,
) -> Array:
    """Vector to a neighbour: that of the step before where it is known, else the lattice's."""
    before = (here[0] - step[0], here[1] - step[1])
    if before in found:
        return found[here] - found[before]
    return np.asarray(step @ vectors)


def _peak(likeness: Array, expected: Array, vectors: Array, away: float) -> Array | None:
    """Place of the greatest likeness around an expected place, between the pixels; None if low."""
    reach = np.maximum(np.abs(vectors).max(axis=0) * away, 1.0)
    low = np.maximum(np.ceil(expected - reach), 0).astype(int)
    high = np.minimum(np.floor(expected + reach) + 1, likeness.shape).astype(int)
    if np.any(high - low < 1):
        return None
    part = likeness[low[0] : high[0], low[1] : high[1]]
    row, column = np.unravel_index(int(part.argmax()), part.shape)
    place = np.array([row + low[0], column + low[1]])
    if likeness[tuple(place)] < LIKE:
        return None
    return np.asarray(place + [_between(likeness, place, axis) for axis in (0, 1)])


def _between(likeness: Array, place: NDArray[np.int64], axis: int) -> float:
    """Offset of a parabola's top through a peak and its neighbours along an axis, in pixels."""
    step = np.eye(2, dtype=int)[axis]
    before, after = place - step, place + step
    if before.min() < 0 or np.any(after >= likeness.shape):
        return 0.0
    left, mid, right = likeness[tuple(before)], likeness[tuple(place)], likeness[tuple(after)]
    curvature = left - 2.0 * mid + right
    return float(np.clip(0.5 * (left - right) / curvature, -0.5, 0.5)) if curvature < 0.0 else 0.0
