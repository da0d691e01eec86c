"""Density of the Preisach plane: the areas that drives sweep, and the weights of its cells.

Croft, Shed and Devasia (2001), Eqs. 11 and 12: the output is the integral of a density over all
relays that are switched up. With the density constant in each cell of a grid it is linear in the
cells' weights, and what multiplies them, the share of each cell that is switched, follows from
the drive alone. So the weights follow from records without reversal curves too.
"""

import math
from typing import TypeAlias

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, refuse_beyond
from afm_scan_ros.core.effects.hysteresis.walk import INPUT, OUTPUT, remember
from afm_scan_ros.core.fit.descent import bounded
from afm_scan_ros.core.types import Array

NOTHING: Array = np.empty(0)
"""No samples."""


@frozen
class CellGrid:
    """Cells of the Preisach plane, ``cells`` a side, from ``lower`` to ``upper`` (V)."""

    lower: float
    upper: float
    cells: int

    @property
    def width(self) -> float:
        """Range of the drive, V."""
        return self.upper - self.lower


def cell_count(cells: int) -> int:
    """Return how many cells a grid of ``cells`` a side has where alpha ≥ beta."""
    return cells * (cells + 1) // 2


def side(count: int) -> int:
    """Return how many cells a side a grid has that has ``count`` of them where alpha ≥ beta."""
    return (math.isqrt(8 * count + 1) - 1) // 2


def swept_areas(drive: Array, grid: CellGrid, before: Array = NOTHING, every: int = 1) -> Array:
    """Share of each cell that is switched up, times two, shape (n // every, cells).

    The drive (V), shape (n,), follows ``before``, shape (m,), which comes from the negative
    saturation, where all is down. Each row is the mean over ``every`` samples of the drive; those
    left over at its end are dropped. Columns run along alpha, within it along beta up to the
    diagonal; the cells on it hold relays whose two thresholds are one. Raises BeyondRangeError for
    a sample out of the range.
    """
    refuse_beyond(before, grid.lower, grid.upper)
    refuse_beyond(drive, grid.lower, grid.upper)
    whole = np.concatenate([before, drive[: len(drive) // every * every]])
    levels = np.clip((whole - grid.lower) * (grid.cells / grid.width), 0.0, grid.cells)
    count = cell_count(grid.cells)
    rows = np.zeros((len(drive) // every, count))
    stack = np.zeros((2, len(levels) + 1))
    saved = np.zeros((_deepest(levels, stack) + 1, count))
    _sweep(levels, len(before), every, stack, saved, rows)
    return rows


def surface_of(weights: Array, grid: CellGrid, offset: float) -> EverettSurface:
    """Everett surface whose cells hold these weights, in the order of ``swept_areas``' columns.

    E(alpha, beta) is the sum over all cells between beta and alpha. Raises InputError where a
    weight on the diagonal is not positive and the surface has no inverse.
    """
    density = np.zeros((grid.cells, grid.cells))
    density[np.tril_indices(grid.cells)] = weights
    values = np.zeros((grid.cells + 1, grid.cells + 1))
    values[1:, :-1] = np.cumsum(np.cumsum(density, axis=0)[:, ::-1], axis=1)[:, ::-1]
    return EverettSurface(grid.lower, grid.upper, np.tril(values), offset)


@compiled
def _deepest(levels: Array, stack: Array) -> int:
    """Return how many extrema are remembered at most; the ``stack`` is left as it was."""
    now, depth, deepest = np.zeros(2), 1, 1
    for k in range(len(levels)):
        depth = remember(stack, depth, now, INPUT, levels[k])
        deepest = max(deepest, depth)
        now[INPUT] = levels[k]
    stack[:] = 0.0
    return deepest


@compiled
def _sweep(levels: Array, before: int, every: int, stack: Array, saved: Array, rows: Array) -> None:
    """Fill ``rows``; ``saved`` holds the areas at each extremum that is remembered."""
    now, depth, row = np.zeros(2), 1, np.zeros(rows.shape[1])
    for k in range(len(levels)):
        way = 2 * (depth % 2) - 1
        if way * levels[k] < way * now[INPUT]:
            saved[depth] = row
        depth = remember(stack, depth, now, INPUT, levels[k])
        base = stack[INPUT, depth - 1]
        row[:] = saved[depth - 1]
        if depth % 2 == 1:
            _switch(row, base, levels[k], 2.0)
        else:
            _switch(row, levels[k], base, -2.0)
        now[INPUT], now[OUTPUT] = levels[k], 0.0
        if k >= before:
            rows[(k - before) // every] += row / every


@compiled
def _switch(row: Array, below: float, above: float, change: float) -> None:
    """Add ``change`` times the share of each cell that lies between two levels (in cells)."""
    for i in range(int(below), int(np.ceil(above))):
        first = i * (i + 1) // 2
        alpha = min(above - i, 1.0)
        for j in range(int(below), i):
            row[first + j] += change * alpha * min(j + 1.0 - below, 1.0)
        row[first + i] += change * max(alpha + min(i + 1.0 - below, 1.0) - 1.0, 0.0)


Indices: TypeAlias = NDArray[np.int64]

REVERSIBLE = 0.01
"""Least weight of all cells on the diagonal, in rms displacements: it gives an inverse."""
ROUNDING = 1e-12
"""Share of the equations' trace that keeps them positive definite where nothing was swept."""


@frozen(eq=False)
class NormalEquations:
    """Equations of the weights from a stretch of record; those of two stretches add up.

    ``gram`` AᵀA (p, p), ``moment`` Aᵀy (p,) in m, ``energy`` yᵀy in m².
    """

    gram: Array
    moment: Array
    energy: float
    samples: float

    @classmethod
    def of(cls, areas: Array, displacement: Array, samples: float) -> "NormalEquations":
        """Take areas A (n, p) and the displacement y (n,), m, whose squares count ``samples``."""
        energy = float(displacement @ displacement)
        return cls(areas.T @ areas, areas.T @ displacement, energy, samples)

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        return NormalEquations(
            self.gram + other.gram,
            self.moment + other.moment,
            self.energy + other.energy,
            self.samples + other.samples,
        )

    def squares(self, weights: Array) -> float:
        """Sum of the squares, m², that these weights leave."""
        return float(self.energy + weights @ (self.gram @ weights - 2.0 * self.moment))


def solve(equations: NormalEquations, smoothing: float) -> Array:
    """Weights (m), shape (p,), none negative.

    Least is the mean square misfit plus ``smoothing`` times the mean square slope of the density,
    over alpha and beta from 0 to 1; so one smoothing serves every size of the grid.
    """
    cells = side(len(equations.moment))
    least = np.zeros_like(equations.moment)
    least[diagonal(cells)] = REVERSIBLE * np.sqrt(equations.energy / equations.samples) / cells
    matrix = equations.gram / equations.samples + smoothing * roughness(cells)
    matrix += ROUNDING * np.trace(matrix) * np.eye(len(matrix))
    return bounded(matrix, equations.moment / equations.samples, np.ones(len(least), bool), least)


def roughness(cells: int) -> Array:
    """Quadratic form of the density's differences between neighbours, shape (p, p).

    The diagonal, where thresholds are equal, has a density of its own, along a line.
    """
    count = cell_count(cells)
    index = np.zeros((cells, cells), dtype=np.int64)
    index[np.tril_indices(cells)] = np.arange(count)
    below = np.tri(cells, k=-1, dtype=bool)
    along_alpha = index[:-1][below[:-1]], index[1:][below[:-1]]
    along_beta = index[:, :-1][below[:, 1:]], index[:, 1:][below[:, 1:]]
    on_diagonal = diagonal(cells)[:-1], diagonal(cells)[1:]
    return cells**4 * (
        _differences(count, *along_alpha) + _differences(count, *along_beta)
    ) + cells**3 * _differences(count, *on_diagonal)


def _differences(count: int, first: Indices, second: Indices) -> Array:
    """Quadratic form Σ (w[second] - w[first])²."""
    steps = np.zeros((len(first), count))
    steps[np.arange(len(first)), first] = -1.0
    steps[np.arange(len(first)), second] = 1.0
    return steps.T @ steps


def diagonal(cells: int) -> Indices:
    """Numbers of the cells, (cells,), whose relays have two thresholds that are one."""
    numbers = np.arange(1, cells + 1)
    return numbers * (numbers + 1) // 2 - 1
