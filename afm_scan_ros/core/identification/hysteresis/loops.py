"""Loops of any kind → the areas that they sweep in the Preisach plane.

Croft, Shed and Devasia (2001), Eqs. 11 and 12: the output is the integral of a density over all
relays that are switched up. With the density constant in each cell of a grid it is linear in the
cells' weights, and what multiplies them, the share of each cell that is switched, follows from
the drive alone. So a record needs no reversal curves to be told which weights made it.
"""

import math

import numpy as np

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, refuse_beyond
from afm_scan_ros.core.effects.hysteresis.walk import INPUT, OUTPUT, remember
from afm_scan_ros.core.types import Array


def cell_count(cells: int) -> int:
    """Return how many cells a grid of ``cells`` a side has where alpha ≥ beta."""
    return cells * (cells + 1) // 2


def side(count: int) -> int:
    """Return how many cells a side a grid has that has ``count`` of them where alpha ≥ beta."""
    return (math.isqrt(8 * count + 1) - 1) // 2


def swept_areas(drive: Array, lower: float, upper: float, cells: int) -> Array:
    """Share of each cell that is switched up, times two, shape (n, cell_count(cells)).

    The drive, V, shape (n,), comes from ``lower``, the negative saturation, where all is down.
    Columns run along alpha, within it along beta up to the diagonal; the cells on it hold relays
    whose two thresholds are one. Raises BeyondRangeError for a sample out of the range.
    """
    refuse_beyond(drive, lower, upper)
    rows = np.zeros((len(drive) + 1, cell_count(cells)))
    stack = np.zeros((2, len(drive) + 1))
    _sweep((drive - lower) * (cells / (upper - lower)), stack, rows)
    return rows[1:]


def surface_of(weights: Array, lower: float, upper: float, offset: float) -> EverettSurface:
    """Everett surface whose cells hold these weights, in the order of ``swept_areas``' columns.

    E(alpha, beta) is the sum over all cells between beta and alpha. Raises InputError where a
    weight on the diagonal is not positive and the surface has no inverse.
    """
    cells = side(len(weights))
    density = np.zeros((cells, cells))
    density[np.tril_indices(cells)] = weights
    values = np.zeros((cells + 1, cells + 1))
    values[1:, :-1] = np.cumsum(np.cumsum(density, axis=0)[:, ::-1], axis=1)[:, ::-1]
    return EverettSurface(lower, upper, np.tril(values), offset)


@compiled
def _sweep(drive: Array, stack: Array, rows: Array) -> None:
    """Fill row k + 1 for sample k; the stack's second line holds the extrema's rows."""
    now, depth = np.zeros(2), 1
    for k in range(len(drive)):
        depth = remember(stack, depth, now, INPUT, drive[k])
        base = stack[INPUT, depth - 1]
        rows[k + 1] = rows[int(stack[OUTPUT, depth - 1])]
        if depth % 2 == 1:
            _switch(rows[k + 1], base, drive[k], 2.0)
        else:
            _switch(rows[k + 1], drive[k], base, -2.0)
        now[INPUT], now[OUTPUT] = drive[k], k + 1


@compiled
def _switch(row: Array, below: float, above: float, change: float) -> None:
    """Add ``change`` times the share of each cell that lies between two levels (in cells)."""
    for i in range(int(below), int(np.ceil(above))):
        first = i * (i + 1) // 2
        alpha = min(above - i, 1.0)
        for j in range(int(below), i):
            row[first + j] += change * alpha * min(j + 1.0 - below, 1.0)
        row[first + i] += change * max(alpha + min(i + 1.0 - below, 1.0) - 1.0, 0.0)
