"""Records of motion of any kinds → density of the hysteresis, vibration and creep, in one fit.

The smoothing of the density is chosen by how well parts of the records predict each other.
"""

from collections.abc import Iterator, Sequence
from functools import reduce
from operator import add

from attrs import frozen

from afm_scan_ros.core.model import ParameterInterval
from afm_scan_ros.core.types import Array, ProgressCallback
from afm_scan_ros.features.images.loops.density import CellGrid, solve
from afm_scan_ros.features.images.loops.moving import (
    LinearDynamics,
    LoopPart,
    MovingRecord,
    Swept,
    loop_parts,
    swept,
)
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
    wholes = (one.whole(found.dynamics).equations for one in swept(records, grid))
    weights = solve(reduce(add, wholes), smoothing)
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


def _within(part: LoopPart, others: Sequence[LoopPart]) -> bool:
    """Whether the others' drives reach as far: no record predicts beyond its drive."""
    near = ALIKE * (part.upper - part.lower)
    lowest = min(other.lower for other in others) - near
    return part.lower >= lowest and part.upper <= max(other.upper for other in others) + near


def _crossed(folds: Sequence[LoopPart], smoothing: float) -> float:
    """Rms error, m, of the parts, each predicted from those of other amplitudes."""
    pairs = list(_each_and_others(folds))
    covered = [pair for pair in pairs if _within(*pair)]
    return _left_out(covered or pairs, smoothing)


def _left_out(pairs: Sequence[tuple[LoopPart, Sequence[LoopPart]]], smoothing: float) -> float:
    """Rms (m) by which each part is missed by a density fitted to the others."""
    squares = 0.0
    for part, others in pairs:
        weights = solve(reduce(add, (other.equations for other in others)), smoothing)
        squares += part.equations.squares(weights)
    return float((max(squares, 0.0) / sum(part.samples for part, _ in pairs)) ** 0.5)


def _each_and_others(
    parts: Sequence[LoopPart],
) -> Iterator[tuple[LoopPart, Sequence[LoopPart]]]:
    """Yield each part and all the others."""
    for k, each in enumerate(parts):
        yield each, [*parts[:k], *parts[k + 1 :]]


def _folds(records: Sequence[Swept], dynamics: LinearDynamics) -> list[LoopPart]:
    """Pieces of like amplitude together; each alone where no amplitude lies within others."""
    pieces = [part for one in records for part in one.parts(dynamics)]
    width = max(piece.upper for piece in pieces) - min(piece.lower for piece in pieces)
    groups: list[list[LoopPart]] = []
    for piece in pieces:
        for group in groups:
            apart = abs(group[0].lower - piece.lower) + abs(group[0].upper - piece.upper)
            if apart < ALIKE * width:
                group.append(piece)
                break
        else:
            groups.append([piece])
    joined = [LoopPart.together(group) for group in groups]
    covered = any(_within(each, others) for each, others in _each_and_others(joined) if others)
    return joined if covered else pieces


def held_out_by_density(
    records: Sequence[Swept], dynamics: LinearDynamics, smoothing: float
) -> float:
    """Rms (m) by which each part is missed by a density of Preisach's fitted to the others."""
    return _left_out(list(_each_and_others(loop_parts(records, dynamics))), smoothing)
