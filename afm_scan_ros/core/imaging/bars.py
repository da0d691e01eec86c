"""Finds the bars of a grating in its image, and the edges of each bar line by line."""

from collections.abc import Iterator

import numpy as np
from attrs import frozen
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
