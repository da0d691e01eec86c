"""Figures of a grating's image: pitch, bow, shift, and the number of bars in view."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.imaging.bars import Edge, bars, edges, half_height
from afm_scan_ros.core.types import Array

METRES = {"unit": "m"}

LONG = 0.25
"""Share of the image's lines that an edge must have for its bow to be told."""


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
