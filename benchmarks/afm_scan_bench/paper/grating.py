"""Figures of a grating's image: pitch, bow, shift, and the number of bars in view.

The bars are found in the image, and the edges of each bar line by line.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy import ndimage

from afm_scan_ros.core.types import Array

GLASS, CHROME = 0.1, 0.9
"""Quantiles of the heights that stand for the two levels; a particle's heights lie beyond."""

IN_VIEW = 0.005
"""Smallest share of an image that counts as a bar in view."""

FOLLOWED = 0.9
"""Share of a bar's lines in which it must be one piece for its edges to be followed."""


@frozen(eq=False)
class Edge:
    """One edge of one bar: at ``y`` (one a line, rising) it lies at ``x``; both (n,), in m."""

    bar: int
    side: str
    x: Array
    y: Array


def half_height(image: Array) -> float:
    """Return the height midway between glass and chrome."""
    finite = image[np.isfinite(image)]
    return float(np.mean(np.quantile(finite, [GLASS, CHROME])))


def bars(image: Array) -> list[NDArray[np.bool_]]:
    """Return each bar in view as a mask of the image, from left to right.

    A bar is what hangs together above half height, also where another lies beside it.
    """
    labels, count = ndimage.label(image > half_height(image))
    masks = [labels == number for number in range(1, count + 1)]
    seen = [mask for mask in masks if mask.mean() > IN_VIEW]
    return sorted(seen, key=_place)


def _place(mask: NDArray[np.bool_]) -> float:
    """Mean column, with the image's tilt, if it has one, left in: bars do not cross."""
    return float(np.argwhere(mask)[:, 1].mean())


def edges(image: Array, columns: Array, rows: Array) -> list[Edge]:
    """Return the left and the right edge of each bar, where they lie within the image.

    A bar that comes apart in many lines, as under strong vibration, has no edge to follow.
    """
    level = half_height(image)
    found = []
    for number, mask in enumerate(bars(image)):
        if _in_one_piece(mask):
            for side in ("left", "right"):
                points = np.array(list(_crossings(image, mask, columns, side, level)))
                if len(points):
                    found.append(Edge(number, side, points[:, 1], rows[points[:, 0].astype(int)]))
    return found


def _in_one_piece(mask: NDArray[np.bool_]) -> bool:
    starts = np.count_nonzero(np.diff(mask.astype(np.int8), axis=1, prepend=0) == 1, axis=1)
    return bool(np.mean(starts[starts > 0] == 1) >= FOLLOWED)


def _crossings(
    image: Array, mask: NDArray[np.bool_], columns: Array, side: str, level: float
) -> Iterator[tuple[int, float]]:
    """Yield the line's number and the place, m, between two pixels where the height is ``level``.

    A bar cut off by the image's border, or by what was never scanned, has no edge there.
    """
    for row in np.flatnonzero(mask.any(axis=1)):
        inside = np.flatnonzero(mask[row])
        pixel, step = (inside[0], -1) if side == "left" else (inside[-1], 1)
        outer = pixel + step
        if 0 <= outer < len(columns) and np.isfinite(image[row, outer]):
            high, low = image[row, pixel], image[row, outer]
            share = (high - level) / (high - low)
            yield int(row), float(columns[pixel] + share * (columns[outer] - columns[pixel]))


METRES = {"unit": "m"}

LONG = 0.25
"""Share of the image's lines that an edge must have for its bow to be measured."""


@frozen
class GratingFigures:
    """Figures of one image, lengths in m; None where the image does not show it.

    ``pitch`` is measured across the bars; ``pitch_spread`` is the standard deviation over all
    places between two neighbouring bars. ``bow`` is the largest sagitta of an edge: of the
    parabola fitted to it, across the bar. ``shift`` is how far the second line is shifted against
    the first where they differ most: positive where its image lies at lower x.
    """

    bars_in_view: int
    pitch: float | None = field(metadata=METRES)
    pitch_spread: float | None = field(metadata=METRES)
    bow: float | None = field(metadata=METRES)
    shift: float | None = field(metadata=METRES)


def grating_figures(image: Array, columns: Array, rows: Array) -> GratingFigures:
    """Measure an image, shape (rows, columns), of a grating whose bars run across its lines.

    ``columns`` and ``rows`` are the pixels' positions, m. Nothing is known of the grating.
    """
    found = edges(image, columns, rows)
    long = [edge for edge in found if len(edge.x) >= LONG * len(rows)]
    if not long:
        return GratingFigures(len(bars(image)), None, None, None, None)
    parabolas = [np.polyfit(edge.y - edge.y.mean(), edge.x, 2) for edge in long]
    slope = float(np.average([p[1] for p in parabolas], weights=[len(edge.x) for edge in long]))
    across = 1.0 / np.hypot(1.0, slope)
    local = across * _distances(found)
    bows = [
        abs(p[0]) * (0.5 * np.ptp(edge.y)) ** 2 for p, edge in zip(parabolas, long, strict=True)
    ]
    shift = first_shift(image, columns)
    return GratingFigures(
        bars_in_view=len(bars(image)),
        pitch=float(local.mean()) if local.size else None,
        pitch_spread=float(local.std()) if local.size else None,
        bow=float(across * max(bows)),
        shift=None if shift is None else shift + slope * float(rows[1] - rows[0]),
    )


def _distances(found: Sequence[Edge]) -> Array:
    """Return the distances along lines, m, of equal sides of neighbouring bars."""
    distances = [np.empty(0)]
    for side in ("left", "right"):
        for one, other in pairwise(edge for edge in found if edge.side == side):
            if other.bar == one.bar + 1:
                _, here, there = np.intersect1d(one.y, other.y, return_indices=True)
                distances.append(other.x[there] - one.x[here])
    return np.concatenate(distances)


def first_shift(image: Array, columns: Array) -> float | None:
    """Return by how much, m, the second line's image lies at lower x than the first's.

    It is the shift of the edge that moved most. Edges are paired from the line's far end, where
    the scanner turns round and hysteresis shifts nothing; None where they are not the same there.
    """
    level = half_height(image)
    first, second = (_line_edges(line, columns, level) for line in image[:2])
    shared = min(len(first), len(second))
    if shared == 0:
        return None
    pairs = np.array([first[-shared:], second[-shared:]])
    moved = pairs[0, :, 0] - pairs[1, :, 0]
    width = np.diff(first[-2:, 0], prepend=columns[0])[-1]
    if np.any(pairs[0, :, 1] != pairs[1, :, 1]) or abs(moved[-1]) > 0.5 * width:
        return None
    return float(moved[np.argmax(np.abs(moved))])


def _line_edges(line: Array, columns: Array, level: float) -> Array:
    """Return place (m) and direction (1 up, -1 down) of each edge of a line, shape (n, 2)."""
    above = line > level
    before = np.flatnonzero(above[1:] != above[:-1])
    share = (level - line[before]) / (line[before + 1] - line[before])
    places = columns[before] + share * (columns[before + 1] - columns[before])
    found = np.column_stack([places, np.where(above[before + 1], 1.0, -1.0)])
    result: Array = found[np.isfinite(places)]
    return result
