"""Parts of loops, each of which a form of hysteresis can predict from the others."""

from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np
from attrs import frozen

from afm_scan_ros.core.identification.joint.density import NormalEquations, solve
from afm_scan_ros.core.identification.joint.moving import (
    LinearDynamics,
    Swept,
    centred,
)
from afm_scan_ros.core.identification.joint.search import parts_of
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class LoopPart:
    """Areas (n, p) and displacement (n,), m, of one stretch of a loop in all records that have it.

    Each record's are without their means, times the root of the samples of a row; they count
    ``samples``.
    """

    areas: Array
    moved: Array
    samples: float


def loop_parts(records: Sequence[Swept], dynamics: LinearDynamics) -> list[LoopPart]:
    """Eighths of each loop; records whose drive has the same range share theirs."""
    groups: dict[tuple[float, int], list[LoopPart]] = {}
    for one in records:
        areas, moved = one.regression(dynamics)
        samples = one.samples[one.memory_known]
        for number, part in enumerate(parts_of([len(moved)])):
            found = LoopPart(
                *centred(areas[part], moved[part], samples[part]), float(samples[part].sum())
            )
            groups.setdefault((float(np.ptp(one.record.drive)), number), []).append(found)
    return [_together(group) for group in groups.values()]


def _together(group: Sequence[LoopPart]) -> LoopPart:
    areas, moved = (np.concatenate([getattr(p, n) for p in group]) for n in ("areas", "moved"))
    return LoopPart(areas, moved, sum(part.samples for part in group))


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
