"""What each cell of the Preisach plane gives where a film holds the plays back.

Where the blocks stand follows from their thresholds alone, and each play's curve is linear in the
weights of the cells; so the blocks are drawn once, for all cells.
"""

from functools import lru_cache

import numpy as np

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.viscous_plays import ViscousPlays, curves
from afm_scan_ros.core.identification.joint.cells import (
    CellGrid,
    cell_count,
    surface_of,
    swept_areas,
)
from afm_scan_ros.core.types import Array


def even(span: CellGrid, more: Array | float = 0.0) -> EverettSurface:
    """Surface of a weight of 1 in each cell, and some ``more``, (cells,)."""
    weights = np.ones(cell_count(span.cells)) + more
    return surface_of(weights, span, offset=0.0)


def shares_behind_film(film: ViscousPlays, drive: Array, span: CellGrid) -> Array:
    """F (n, cells) for each cell's weight, for a drive (n,) in V from negative saturation on."""
    shares = swept_areas(drive, span)
    nodes, unit = np.arange(span.cells + 1.0), _unit_curves(span)
    late, free = film.followed(drive)
    for play, curve in enumerate(unit):
        of_play = np.flatnonzero(curve.any(axis=0))
        ways = (places[:, play, np.newaxis] - 0.5 * play for places in (late, free))
        late_hat, free_hat = (np.maximum(1.0 - np.abs(way - nodes), 0.0) for way in ways)
        shares[:, of_play] += (late_hat - free_hat) @ curve[:, of_play]
    return shares


@lru_cache
def _unit_curves(span: CellGrid) -> Array:
    """Curve of each play that a weight of 1 in each cell makes (plays, nodes, cells)."""
    bare = curves(even(span))[1]
    ones = np.eye(cell_count(span.cells))
    return np.stack([curves(even(span, one))[1] - bare for one in ones], axis=-1)
