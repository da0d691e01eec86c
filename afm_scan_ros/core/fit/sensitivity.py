"""∂displacement/∂θ of a record, averaged over stretches, and its transpose.

From A = F + Σ c_j q_j(F), the map behind the operator, follow ∂F/∂A = 1 / (dA/dF) and
∂F/∂c_j = -q_j(F) / (dA/dF). These pass V, C and M as inputs known over stretches.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from afm_scan_ros.core.fit.parameters import Columns
from afm_scan_ros.core.fit.simulation import Simulation, by_rest
from afm_scan_ros.core.fit.stretch_filter import StretchFilter
from afm_scan_ros.core.types import Array


def jacobian(
    simulation: Simulation, pieces: Iterable[Columns] | None
) -> Iterator[tuple[slice, Array]]:
    """Yield ∂y/∂θ for a gain of 1 in pieces, shape (stretches, size), averaged over stretches.

    Each row is multiplied by the weight of its stretch, and comes with its place among all that
    count. ``pieces`` are those of ∂A/∂(operator), averaged over all stretches; without them the
    operator is held.
    """
    layout, record = simulation.layout, simulation.record
    parts, used, late = layout.parts, record.stretches, simulation.states.late
    vibration = slice(parts["lags"].start, parts["modes"].stop)
    memory, count = layout.memory_part(record), 0 if pieces is None else parts["map"].stop
    first = 0
    for one in _of_operator(simulation, pieces):
        last = first + len(one)
        if last > used.start:
            rows = slice(max(first, used.start), last)
            result = np.zeros((last - rows.start, layout.size))
            result[:, :count] = one[rows.start - first :, :count]
            result[:, memory] = one[rows.start - first :, count:]
            result[:, vibration] = simulation.vibration[rows]
            result[:, parts["creep"]] = late[rows]
            result[:, parts["sensor"]] = simulation.sensed[rows]
            place = slice(rows.start - used.start, last - used.start)
            result *= record.weights[place, np.newaxis]
            yield place, result
        first = last


def pulled(simulation: Simulation, pieces: Iterable[Columns] | None, pull: Array) -> Array:
    """Return Jᵀ pull, shape (size, n), with the J of ``jacobian``, without making it.

    What V and C do to the columns of J is done backwards to ``pull``, (stretches that count, n).
    Without ``pieces`` the rows of the record's memory are zero.
    """
    layout, record = simulation.layout, simulation.record
    parts, whole = layout.parts, np.zeros((len(record.edges) - 1, pull.shape[1]))
    whole[record.stretches] = pull * record.weights[:, np.newaxis]
    result = np.zeros((layout.size, pull.shape[1]))
    result[parts["lags"].start : parts["modes"].stop] = simulation.vibration.T @ whole
    result[parts["creep"]] = simulation.states.late.T @ whole
    result[parts["sensor"]] = simulation.sensed.T @ whole
    if pieces is not None:
        bank, first = simulation.dynamics.parallel(), 0
        through = StretchFilter(bank, 0.0, record.period, record.edges, np.zeros(1))
        inputs, settled = through.pulled(whole)
        if record.rested:
            known = np.r_[: parts["map"].stop, layout.memory_part(record)]
            result[known] += np.outer(by_rest(layout, simulation.theta), settled)
        else:
            inputs[0] += settled
        inputs /= simulation.slopes[:, np.newaxis]
        result[parts["map"]] -= simulation.bends.T @ inputs
        result[layout.memory_part(record)] += simulation.remembered.T @ inputs
        for columns in pieces:
            part = inputs[first : first + len(columns)]
            result[: columns.shape[1]] += columns.T @ part
            first += len(columns)
    return result


def _of_operator(simulation: Simulation, pieces: Iterable[Columns] | None) -> Iterator[Array]:
    """Derivatives by the operator and its map, through V, C and M.

    Last come those by the record's memory, which are alone where the operator is held.
    """
    record, bends = simulation.record, simulation.bends
    if pieces is None:
        pieces, bends = [np.zeros((len(bends), 0))], bends[:, :0]
    bank, first = simulation.dynamics.parallel(), 0
    through, waiting = None, np.zeros((0, 0))
    for columns in pieces:
        part, first = slice(first, first + len(columns)), first + len(columns)
        others = -bends[part], simulation.remembered[part]
        inputs = np.hstack([columns.astype(float), *others])
        inputs /= simulation.slopes[part, np.newaxis]
        if through is None:
            settled = inputs[0]
            if record.rested:
                known = by_rest(simulation.layout, simulation.theta)
                settled = known[len(known) - len(settled) :]
            through = StretchFilter(bank, 0.0, record.period, record.edges, settled)
        else:
            yield through(waiting, inputs[0])
        waiting = inputs
    if through is not None:
        yield through(waiting)
