"""Records of motion of any kinds → density of the hysteresis, vibration and creep, in one fit.

The smoothing of the density is chosen by how well parts of the records predict each other.
"""

from collections.abc import Iterator, Sequence
from functools import reduce
from operator import add

import numpy as np
from attrs import frozen

from afm_scan_ros.core.model import ParameterInterval
from afm_scan_ros.core.types import Array, ProgressCallback
from afm_scan_ros.features.images.loops import moving
from afm_scan_ros.features.images.loops.density import CellGrid, NormalEquations, solve
from afm_scan_ros.features.images.loops.moving import LinearDynamics, MovingRecord, Swept, swept
from afm_scan_ros.features.images.loops.search import (
    NO_CREEP,
    Densities,
    Form,
    Found,
    Lag,
    OneCreep,
    at_once,
    rippling,
    search,
)

COARSE, FINER, FINE = 12, 24, 40
"""Cells a side: of the grids on which dynamics and smoothing are sought, and of the last one."""
WEAK_SMOOTHING = 1e-8
"""Smoothing of a density that hides no lag."""
SMOOTHINGS = tuple(10.0**exponent for exponent in range(-9, -2))
"""Smoothings to choose from."""
ALIKE = 0.1
"""Share of the range by which the drives of two parts may differ and count as one amplitude."""


@frozen(eq=False)
class JointFit:
    """Weights (m) of the cells of a grid, under a smoothing, and what follows the hysteresis.

    ``vibration`` and ``creep`` hold the intervals of what was sought and identified of them; None
    where it was not sought, or the records do not identify it.
    """

    weights: Array
    grid: CellGrid
    dynamics: LinearDynamics
    vibration: tuple[ParameterInterval, ...] | None
    creep: tuple[ParameterInterval, ...] | None
    smoothing: float


def fit_jointly(
    records: Sequence[MovingRecord], progress: ProgressCallback, *, at_rates: bool
) -> JointFit:
    """Fit the hysteresis of all records; ``at_rates``, also what follows it: vibration and creep.

    Where a resonance ripples, no lag is sought beside it. Raises ScanError where a search does not
    converge.
    """
    grids = [list(swept(records, grid_of(records, cells))) for cells in (COARSE, FINER)]
    shortest = min(record.sample_period for record in records)
    known, ripple = LinearDynamics(at_once(1.0, shortest), NO_CREEP), None
    forms: list[Form] = []
    if at_rates:
        progress("seeking a resonance")
        ripple = rippling(grids[0], WEAK_SMOOTHING, known)
        known = known if ripple is None else ripple.dynamics
        forms = [*([Lag(records)] if ripple is None else []), OneCreep(records)]
    progress("seeking what follows the hysteresis")
    forms, found = _sought(grids, known, forms)
    intervals = dict(zip(map(type, forms), found.intervals, strict=True))
    folds = _folds(grids[0], found.dynamics)
    smoothing = min(SMOOTHINGS, key=lambda choice: _crossed(folds, choice))
    progress("fitting the hysteresis")
    grid = grid_of(records, FINE)
    rows = ((*one.weighted(found.dynamics), one.counted) for one in swept(records, grid))
    weights = solve(reduce(add, (NormalEquations.of(*each) for each in rows)), smoothing)
    rings = intervals.get(Lag) if ripple is None else ripple.intervals[0]
    return JointFit(weights, grid, found.dynamics, rings, intervals.get(OneCreep), smoothing)


def grid_of(records: Sequence[MovingRecord], cells: int) -> CellGrid:
    """Lay a grid of so many ``cells`` a side over the range of all drives and rest."""
    lower = min(0.0, *(float(record.drive.min()) for record in records))
    upper = max(0.0, *(float(record.drive.max()) for record in records))
    return CellGrid(lower, upper, cells)


def _sought(
    grids: Sequence[Sequence[Swept]], known: LinearDynamics, forms: Sequence[Form]
) -> tuple[list[Form], Found]:
    """Search for forms grid by grid, and again without those that the records do not identify.

    Returns those that are left, and what was found of them.
    """
    found = search(Densities(grids[0], WEAK_SMOOTHING), known, forms)
    for records in grids[1:]:
        if all(found.identified):
            found = search(Densities(records, WEAK_SMOOTHING), known, forms, found.values)
    if all(found.identified):
        return list(forms), found
    fewer = [form for form, seen in zip(forms, found.identified, strict=True) if seen]
    return _sought(grids, known, fewer)


@frozen(eq=False)
class _Fold:
    """Pieces of one amplitude: their equations, means removed, and their drive's range (V)."""

    equations: NormalEquations
    lower: float
    upper: float

    def __add__(self, other: "_Fold") -> "_Fold":
        ends = min(self.lower, other.lower), max(self.upper, other.upper)
        return _Fold(self.equations + other.equations, *ends)

    def within(self, others: Sequence["_Fold"]) -> bool:
        """Whether the others' drives reach as far: no record predicts beyond its drive."""
        near = ALIKE * (self.upper - self.lower)
        lowest = min(fold.lower for fold in others) - near
        return self.lower >= lowest and self.upper <= max(fold.upper for fold in others) + near


def _crossed(folds: Sequence[_Fold], smoothing: float) -> float:
    """Rms error, m, of the parts, each predicted from those of other amplitudes."""
    squares, samples = 0.0, 0.0
    covered = any(each.within(others) for each, others in _each_and_others(folds))
    for left_out, others in _each_and_others(folds):
        if left_out.within(others) or not covered:
            weights = solve(reduce(add, (fold.equations for fold in others)), smoothing)
            squares += left_out.equations.squares(weights)
            samples += left_out.equations.samples
    return float((max(squares, 0.0) / samples) ** 0.5)


def _each_and_others(folds: Sequence[_Fold]) -> Iterator[tuple[_Fold, Sequence[_Fold]]]:
    """Yield each part and all the others."""
    for k, each in enumerate(folds):
        yield each, [*folds[:k], *folds[k + 1 :]]


def _folds(records: Sequence[Swept], dynamics: LinearDynamics) -> list[_Fold]:
    """Pieces of like amplitude together; each alone where no amplitude lies within others."""
    parts = (part for one in records for part in one.parts(dynamics))
    pieces = [
        _Fold(NormalEquations.of(each.areas, each.moved, each.samples), each.lower, each.upper)
        for each in parts
    ]
    width = max(fold.upper for fold in pieces) - min(fold.lower for fold in pieces)
    groups: list[list[_Fold]] = []
    for piece in pieces:
        for group in groups:
            apart = abs(group[0].lower - piece.lower) + abs(group[0].upper - piece.upper)
            if apart < ALIKE * width:
                group.append(piece)
                break
        else:
            groups.append([piece])
    joined = [reduce(add, group) for group in groups]
    covered = any(each.within(others) for each, others in _each_and_others(joined) if others)
    return joined if covered else pieces


def held_out_by_density(
    records: Sequence[Swept], dynamics: LinearDynamics, smoothing: float
) -> float:
    """Rms (m) by which each part is missed by a density of Preisach's fitted to the others."""
    parts = [
        NormalEquations.of(each.areas, each.moved, each.samples)
        for each in moving.loop_parts(records, dynamics)
    ]
    squares = 0.0
    for k, part in enumerate(parts):
        others = reduce(add, [*parts[:k], *parts[k + 1 :]])
        squares += max(part.squares(solve(others, smoothing)), 0.0)
    return float(np.sqrt(squares / sum(part.samples for part in parts)))
