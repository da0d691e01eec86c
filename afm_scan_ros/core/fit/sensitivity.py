"""The model of a record: its displacement by samples, and ∂displacement/∂θ by stretches."""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.hysteresis.preisach import terms
from afm_scan_ros.core.fit.dynamics import PoleBank, Response, StretchFilter, respond
from afm_scan_ros.core.fit.parameters import Columns, Layout
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.fit.stretches import means
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Simulation:
    """Effective input F (V), (n,), the one at which the scanner had settled, and the response."""

    effective: Array
    settled: float
    dynamics: PoleBank
    response: Response


def simulate(layout: Layout, theta: Array, record: Signals) -> Simulation:
    """Simulate a record exactly; raises InputError where the map behind the operator turns back."""
    operator, mapped = layout.of_operator(theta), layout.map_of(theta)
    before = np.zeros(1) if record.rested else record.drive[:1]
    memory = layout.memory_of(theta, record)
    raw, rest = (layout.operator.output(operator, one, memory) for one in (record.drive, before))
    if mapped is not None:
        raw, rest = mapped.output(raw), mapped.output(rest)
    settled, dynamics = float(rest[0]), layout.dynamics(theta)
    response = respond(dynamics, record.period, raw, record.block, record.edges, settled)
    return Simulation(raw, settled, dynamics, response)


def jacobian(
    layout: Layout,
    theta: Array,
    record: Signals,
    simulation: Simulation,
    pieces: Iterable[Columns] | None,
) -> Iterator[tuple[slice, Array]]:
    """Yield ∂y/∂θ for a gain of 1 in pieces, shape (stretches, size), averaged over stretches.

    Each row is multiplied by the weight of its stretch, and comes with its place among all that
    count. ``pieces`` are those of ∂A/∂(operator), averaged over all stretches; without them the
    operator is held.
    """
    parts, used = layout.parts, record.stretches
    vibration = slice(parts["lags"].start, parts["modes"].stop)
    moved, late = of_vibration(layout, theta, record, simulation), simulation.response.late
    corner = _of_sensor(layout, theta, record, simulation)
    memory, count = layout.memory_part(record), 0 if pieces is None else parts["map"].stop
    first = 0
    for one in _of_operator(layout, theta, record, simulation, pieces):
        last = first + len(one)
        if last > used.start:
            rows = slice(max(first, used.start), last)
            result = np.zeros((last - rows.start, layout.size))
            result[:, :count] = one[rows.start - first :, :count]
            result[:, memory] = one[rows.start - first :, count:]
            result[:, vibration] = moved[rows]
            result[:, parts["creep"]] = late[rows]
            result[:, parts["sensor"]] = corner[rows]
            place = slice(rows.start - used.start, last - used.start)
            result *= record.weights[place, np.newaxis]
            yield place, result
        first = last


def pulled(
    layout: Layout,
    theta: Array,
    record: Signals,
    simulation: Simulation,
    pieces: Iterable[Columns] | None,
    pull: Array,
) -> Array:
    """Return Jᵀ pull, shape (size,), with the J of ``jacobian``, without making it.

    What V and C do to the columns of J is done backwards to ``pull``, (stretches that count,).
    """
    parts, whole = layout.parts, np.zeros(len(record.edges) - 1)
    whole[record.stretches] = pull * record.weights
    result = np.zeros(layout.size)
    vibration = slice(parts["lags"].start, parts["modes"].stop)
    result[vibration] = whole @ of_vibration(layout, theta, record, simulation)
    result[parts["creep"]] = whole @ simulation.response.late
    result[parts["sensor"]] = whole @ _of_sensor(layout, theta, record, simulation)
    if pieces is not None:
        mapped, bank, first = layout.map_of(theta), simulation.dynamics.parallel(), 0
        through = StretchFilter(bank, 0.0, record.period, record.edges, np.zeros(1))
        inputs, settled = through.pulled(whole)
        if record.rested:
            result[: parts["map"].stop] += settled * _by_rest(layout, theta)
        else:
            inputs[0] += settled
        if mapped is not None:
            inputs /= mapped.slope(means(simulation.effective, record.edges))
        bends = _bends(layout, record, simulation)
        result[parts["map"]] -= inputs @ bends
        result[layout.memory_part(record)] = inputs @ _remembered(layout, theta, record)
        for columns in pieces:
            part = inputs[first : first + len(columns)]
            result[: columns.shape[1]] += np.matmul(part.astype(columns.dtype), columns)
            first += len(columns)
    return result


def _of_operator(
    layout: Layout,
    theta: Array,
    record: Signals,
    simulation: Simulation,
    pieces: Iterable[Columns] | None,
) -> Iterator[Array]:
    """Derivatives by the operator and its map, as inputs known over stretches, through V and C.

    From A = F + Σ c_j q_j(F) follow ∂F/∂A = 1 / (dA/dF) and ∂F/∂c_j = -q_j(F) / (dA/dF). Last come
    those by the record's memory, which are alone where the operator is held.
    """
    effective, mapped = means(simulation.effective, record.edges), layout.map_of(theta)
    bends = _bends(layout, record, simulation)
    slopes = np.ones_like(effective) if mapped is None else mapped.slope(effective)
    held = pieces is None
    if pieces is None:
        pieces, bends = [np.zeros((len(effective), 0))], bends[:, :0]
    remembered = _remembered(layout, theta, record)
    bank, first = simulation.dynamics.parallel(), 0
    through, waiting = None, np.zeros((0, 0))
    for columns in pieces:
        part, first = slice(first, first + len(columns)), first + len(columns)
        inputs = np.hstack([columns.astype(float), -bends[part], remembered[part]])
        inputs /= slopes[part, np.newaxis]
        if through is None:
            rest = np.zeros(0) if held else _by_rest(layout, theta)
            settled = rest if record.rested else inputs[0]
            through = StretchFilter(bank, 0.0, record.period, record.edges, settled)
        else:
            yield through(waiting, inputs[0])
        waiting = inputs
    if through is not None:
        yield through(waiting)


def _bends(layout: Layout, record: Signals, simulation: Simulation) -> Array:
    """Means of the map's terms q_j(F) over stretches, (stretches, terms)."""
    operator = layout.operator
    every = terms(simulation.effective, operator.lower, operator.upper, operator.bends)
    return means(every, record.edges)


def _remembered(layout: Layout, theta: Array, record: Signals) -> Array:
    """∂A/∂memory averaged over stretches, (stretches, unknowns); none where the start is known."""
    memory = layout.memory_of(theta, record)
    if record.unknown is None or memory is None:
        return np.zeros((len(record.edges) - 1, 0))
    given = layout.of_operator(theta), record.drive, record.edges, memory
    return layout.operator.remembered(*given)


def at_rest(layout: Layout, theta: Array) -> Array:
    """F (V) at depolarised rest, shape (1,)."""
    mapped, at = (
        layout.map_of(theta),
        layout.operator.output(layout.of_operator(theta), np.zeros(1), None),
    )
    return at if mapped is None else mapped.output(at)


def _by_rest(layout: Layout, theta: Array) -> Array:
    """Derivatives of F at depolarised rest by the operator and its map."""
    operator, given, rest = layout.operator, layout.of_operator(theta), np.zeros(1)
    mapped, at = layout.map_of(theta), at_rest(layout, theta)
    (columns,) = operator.pieces(given, rest, np.arange(2), None)
    bends = terms(at, operator.lower, operator.upper, operator.bends)
    slope = 1.0 if mapped is None else mapped.slope(at)[0]
    return np.asarray(np.concatenate([columns[0], -bends[0]]) / slope)


def of_vibration(layout: Layout, theta: Array, record: Signals, simulation: Simulation) -> Array:
    """Derivatives of all stretches by the weights of the lags, and by what θ holds of each mode."""
    dynamics = simulation.dynamics
    modes, changes, lags = dynamics.seen(simulation.response)
    columns, settled = [lags], [np.full(lags.shape[1], simulation.settled)]
    for i, (omega, damping, *_) in enumerate(layout.of_modes(theta)):
        state, change = modes[:, i], dynamics.weights[i] * changes[:, i]
        pole = dynamics.poles[i]
        turned = omega * damping * (1.0 + 1j * damping / np.sqrt(1.0 - damping**2))
        moved = [(change * pole).real, (change * turned).real, state.real, -state.imag]
        columns.append(np.column_stack(moved))
        settled.append(np.array([0.0, 0.0, simulation.settled, 0.0]))
    slow = (-1.0 / layout.time_constants).astype(np.complex128)
    bank = slow, dynamics.gains.astype(np.complex128)
    creep = StretchFilter(bank, 1.0, record.period, record.edges, np.concatenate(settled))
    return creep(np.hstack(columns))


def _of_sensor(layout: Layout, theta: Array, record: Signals, simulation: Simulation) -> Array:
    """Derivative by the logarithm of the sensor's corner, (stretches, 1), by a difference.

    There is no column without a sensor.
    """
    part, apart = layout.parts["sensor"], float(np.cbrt(np.finfo(float).eps))
    step = np.zeros(layout.size)
    step[part] = apart
    block, edges = record.block, record.edges
    given = record.period, simulation.effective, block, edges, simulation.settled
    ends = [layout.dynamics(theta + way * step) for way in (1.0, -1.0) if layout.sensor_order]
    if not ends:
        return np.zeros((len(edges) - 1, 0))
    up, down = (means(respond(one, *given).output, edges // block) for one in ends)
    return np.asarray((up - down)[:, np.newaxis] / (2.0 * apart))
