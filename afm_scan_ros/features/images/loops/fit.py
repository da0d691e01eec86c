"""Records of motion of any kinds → density of the hysteresis, vibration and creep, in one fit.

The smoothing of the density is chosen by how well parts of the records predict each other.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from operator import add

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.model import ParameterInterval
from afm_scan_ros.core.types import Array, ProgressCallback
from afm_scan_ros.features.images.loops.density import (
    CellGrid,
    NormalEquations,
    solve,
)
from afm_scan_ros.features.images.loops.moving import (
    LinearDynamics,
    MovingRecord,
    Swept,
    centred,
    loop_parts,
    parts_of,
    swept,
)
from afm_scan_ros.features.images.loops.ringing import Ringing, resonance
from afm_scan_ros.features.images.loops.ripple import rippling
from afm_scan_ros.features.images.loops.search import (
    LAGS,
    NO_CREEP,
    Densities,
    Form,
    Lag,
    OneCreep,
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
    """Weights (m) of the cells of a grid, and what follows the hysteresis.

    ``vibration`` and ``creep`` hold the intervals of what was sought and identified of them; None
    where the records do not identify it, or where it was known. ``fitted`` is the rms misfit (m) to
    the rows fitted, ``held_out`` that of each part under a fit of the others, on the coarse grid.
    """

    weights: Array
    grid: CellGrid
    dynamics: LinearDynamics
    vibration: tuple[ParameterInterval, ...] | None
    creep: tuple[ParameterInterval, ...] | None
    smoothing: float
    fitted: float
    held_out: float


@frozen(eq=False)
class _Solution:
    """Dynamics, intervals of what the records identify, smoothing and the held-out error."""

    dynamics: LinearDynamics
    intervals: dict[type[Form], tuple[ParameterInterval, ...]]
    smoothing: float
    held_out: float


def fit_jointly(
    records: Sequence[MovingRecord],
    vibration: VibrationModel | None,
    creep: CreepModel | None,
    progress: ProgressCallback,
) -> JointFit:
    """Fit all records; the vibration (of gain 1 at rest) and the creep are sought where None.

    Where a resonance rings, no lag is sought beside it. Raises ScanError where a search does not
    converge.
    """
    grids = [list(swept(records, grid_of(records, cells))) for cells in (COARSE, FINER)]
    rings = None
    if vibration is None:
        progress("seeking a resonance")
        rings = _resonance(records, grids[0])
        vibration = None if rings is None else rings.vibration
    progress("seeking what follows the hysteresis")
    solution = _sought(records, grids, vibration, creep, WEAK_SMOOTHING)
    progress("fitting the hysteresis")
    grid = grid_of(records, FINE)
    found = _fitted(swept(records, grid), grid, solution)
    if rings is None:
        return found
    return evolve(found, vibration=rings.intervals)


def _resonance(records: Sequence[MovingRecord], coarse: Sequence[Swept]) -> Ringing | None:
    """Seek decays after the turns, or ripple where the records do not show the turns."""
    if all(record.measured is None for record in records):
        return resonance(records)
    still = LinearDynamics(_still(min(record.sample_period for record in records)), NO_CREEP)
    return rippling(coarse, WEAK_SMOOTHING, still)


def _weights(records: Iterable[Swept], solution: _Solution) -> tuple[Array, float]:
    """Fit the density on a grid: its weights (m), and the rms of the residual (m)."""
    each = (NormalEquations.of(*one.weighted(solution.dynamics), one.counted) for one in records)
    whole = reduce(add, each)
    weights = solve(whole, solution.smoothing)
    return weights, whole.rms(weights)


def _fitted(records: Iterable[Swept], grid: CellGrid, solution: _Solution) -> JointFit:
    weights, residual = _weights(records, solution)
    return JointFit(
        weights=weights,
        grid=grid,
        dynamics=solution.dynamics,
        vibration=solution.intervals.get(Lag),
        creep=solution.intervals.get(OneCreep),
        smoothing=solution.smoothing,
        fitted=residual,
        held_out=solution.held_out,
    )


def grid_of(records: Sequence[MovingRecord], cells: int) -> CellGrid:
    """Lay a grid of so many ``cells`` a side over the range of all drives and rest."""
    lower = min(0.0, *(float(record.drive.min()) for record in records))
    upper = max(0.0, *(float(record.drive.max()) for record in records))
    return CellGrid(lower, upper, cells)


def _sought(
    records: Sequence[MovingRecord],
    grids: Sequence[Sequence[Swept]],
    vibration: VibrationModel | None,
    creep: CreepModel | None,
    smoothing: float,
) -> _Solution:
    """Seek what is not known by a lag and one creep, and choose the smoothing."""
    still = _still(min(record.sample_period for record in records))
    forms: list[Form] = [Lag(records)] if vibration is None else []
    forms += [OneCreep(records)] if creep is None else []
    return _solution(grids, LinearDynamics(vibration or still, creep or NO_CREEP), forms, smoothing)


def _still(period: float) -> VibrationModel:
    """Vibration too fast for samples of a ``period`` (s) to show."""
    return VibrationModel((1.0,), (float(LAGS[0]) * period, 1.0))


def _solution(
    grids: Sequence[Sequence[Swept]], known: LinearDynamics, forms: Sequence[Form], smoothing: float
) -> _Solution:
    """Search for forms grid by grid, and again without those that the records do not identify."""
    found = search(Densities(grids[0], smoothing), known, forms)
    for records in grids[1:]:
        if all(found.identified):
            found = search(Densities(records, smoothing), known, forms, found.values)
    if not all(found.identified):
        fewer = [form for form, seen in zip(forms, found.identified, strict=True) if seen]
        return _solution(grids, known, fewer, smoothing)
    chosen, held_out = _cross_validated(grids[0], found.dynamics)
    intervals = dict(zip(map(type, forms), found.intervals, strict=True))
    return _Solution(found.dynamics, intervals, chosen, held_out)


def _cross_validated(records: Sequence[Swept], dynamics: LinearDynamics) -> tuple[float, float]:
    """Smoothing under which the parts predict each other best, and how well, m rms."""
    folds = _folds(records, dynamics)
    return min((_crossed(folds, choice), choice) for choice in SMOOTHINGS)[::-1]


@frozen(eq=False)
class _Fold:
    """Pieces of one amplitude: their equations, means removed, and their drive's range (V)."""

    equations: NormalEquations
    lower: float
    upper: float

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
    pieces = [fold for one in records for fold in _pieces_of(one, dynamics)]
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
    joined = [_joined(group) for group in groups]
    covered = any(each.within(others) for each, others in _each_and_others(joined) if others)
    return joined if covered else pieces


def _joined(group: Sequence[_Fold]) -> _Fold:
    return _Fold(
        reduce(add, (fold.equations for fold in group)),
        min(fold.lower for fold in group),
        max(fold.upper for fold in group),
    )


def _pieces_of(one: Swept, dynamics: LinearDynamics) -> Iterator[_Fold]:
    areas, moved = one.regression(dynamics)
    drive = one.record.drive[: len(one.moved) * one.every].reshape(len(one.moved), -1)[
        one.memory_known
    ]
    for part in parts_of([len(moved)]):
        samples = one.samples[one.memory_known][part]
        rows = centred(areas[part], moved[part], samples)
        equations = NormalEquations.of(*rows, float(samples.sum()))
        yield _Fold(equations, float(drive[part].min()), float(drive[part].max()))


def held_out_by_density(
    records: Sequence[Swept], dynamics: LinearDynamics, smoothing: float
) -> float:
    """Rms (m) by which each part is missed by a density of Preisach's fitted to the others."""
    parts = [
        NormalEquations.of(each.areas, each.moved, each.samples)
        for each in loop_parts(records, dynamics)
    ]
    squares = 0.0
    for k, part in enumerate(parts):
        others = reduce(add, [*parts[:k], *parts[k + 1 :]])
        squares += max(part.squares(solve(others, smoothing)), 0.0)
    return float(np.sqrt(squares / sum(part.samples for part in parts)))
