"""The model of a record: its displacement sample by sample, and ∂displacement/∂θ block by block."""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.hysteresis.preisach import terms
from afm_scan_ros.core.fit.dynamics import HeldFilter, PoleBank, Response, pulled_inputs, respond
from afm_scan_ros.core.fit.parameters import Columns, Layout
from afm_scan_ros.core.fit.signals import Signals, averaged
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
    raw = layout.operator.output(operator, record.drive, rested=record.rested)
    rest = layout.operator.output(operator, before, rested=record.rested)
    if mapped is not None:
        raw, rest = mapped.output(raw), mapped.output(rest)
    settled, dynamics = float(rest[0]), layout.dynamics(theta)
    response = respond(dynamics, record.period, raw, record.block, settled)
    return Simulation(raw, settled, dynamics, response)


def jacobian(
    layout: Layout,
    theta: Array,
    record: Signals,
    simulation: Simulation,
    pieces: Iterable[Columns] | None,
) -> Iterator[tuple[slice, Array]]:
    """Yield ∂y/∂θ for a gain of 1 in pieces, shape (blocks, size), averaged over blocks.

    Each comes with the place of its blocks among all that count. ``pieces`` are those of
    ∂A/∂(operator), averaged over all blocks; without them the operator is held.
    """
    parts, used = layout.parts, record.used
    vibration = slice(parts["lags"].start, parts["modes"].stop)
    moved, late = _of_vibration(layout, theta, record, simulation), simulation.response.late
    if pieces is None:
        of_operator = iter([np.zeros((record.blocks, parts["map"].stop))])
    else:
        of_operator = _of_operator(layout, theta, record, simulation, pieces)
    first = 0
    for one in of_operator:
        last = first + len(one)
        if last > used.start:
            rows = slice(max(first, used.start), last)
            result = np.empty((last - rows.start, layout.size))
            result[:, : parts["map"].stop] = one[rows.start - first :]
            result[:, vibration] = moved[rows]
            result[:, parts["creep"]] = late[rows]
            yield slice(rows.start - used.start, last - used.start), result
        first = last


def pulled(
    layout: Layout,
    theta: Array,
    record: Signals,
    simulation: Simulation,
    pieces: Iterable[Columns] | None,
    pull: Array,
) -> Array:
    """Return Jᵀ pull, shape (size,), with the blocks' J of ``jacobian``, without making it.

    What V and C do to the columns of J is done backwards to ``pull``, shape (blocks that count,).
    """
    parts, whole = layout.parts, np.zeros(record.blocks)
    whole[record.used] = pull
    result = np.zeros(layout.size)
    vibration = slice(parts["lags"].start, parts["modes"].stop)
    result[vibration] = whole @ _of_vibration(layout, theta, record, simulation)
    result[parts["creep"]] = whole @ simulation.response.late
    if pieces is not None:
        operator, mapped = layout.operator, layout.map_of(theta)
        bank, first = simulation.dynamics.parallel(), 0
        inputs, settled = pulled_inputs(bank, record.period, whole, record.block)
        if record.rested:
            result[: parts["map"].stop] += settled * _at_rest(layout, theta)
        else:
            inputs[0] += settled
        effective = averaged(simulation.effective, record.block)
        if mapped is not None:
            inputs /= mapped.slope(effective)
        bends = terms(effective, operator.lower, operator.upper, operator.bends)
        result[parts["map"]] -= inputs @ bends
        for columns in pieces:
            part = inputs[first : first + len(columns)]
            result[: columns.shape[1]] += np.matmul(part.astype(columns.dtype), columns)
            first += len(columns)
    return result


def _of_operator(
    layout: Layout, theta: Array, record: Signals, simulation: Simulation, pieces: Iterable[Columns]
) -> Iterator[Array]:
    """Derivatives by the operator and its map, as inputs held over blocks, through V and C.

    From A = F + Σ c_j q_j(F) follow ∂F/∂A = 1 / (dA/dF) and ∂F/∂c_j = -q_j(F) / (dA/dF).
    """
    operator, mapped = layout.operator, layout.map_of(theta)
    effective = averaged(simulation.effective, record.block)
    bends = terms(effective, operator.lower, operator.upper, operator.bends)
    slopes = np.ones_like(effective) if mapped is None else mapped.slope(effective)
    bank, first, through = simulation.dynamics.parallel(), 0, None
    for columns in pieces:
        part, first = slice(first, first + len(columns)), first + len(columns)
        inputs = np.hstack([columns.astype(float), -bends[part]])
        inputs /= slopes[part, np.newaxis]
        if through is None:
            settled = _at_rest(layout, theta) if record.rested else inputs[0]
            through = HeldFilter(bank, 0.0, record.length, record.block, settled)
        yield through(inputs)


def _at_rest(layout: Layout, theta: Array) -> Array:
    """Derivatives of F at depolarised rest by the operator and its map."""
    operator, given, rest = layout.operator, layout.of_operator(theta), np.zeros(1)
    mapped, at = layout.map_of(theta), operator.output(given, rest, rested=True)
    at = at if mapped is None else mapped.output(at)
    (columns,) = operator.pieces(given, rest, 1, rested=True)
    bends = terms(at, operator.lower, operator.upper, operator.bends)
    slope = 1.0 if mapped is None else mapped.slope(at)[0]
    return np.asarray(np.concatenate([columns[0], -bends[0]]) / slope)


def _of_vibration(layout: Layout, theta: Array, record: Signals, simulation: Simulation) -> Array:
    """Derivatives by the weights of the lags, and by what θ holds of each mode."""
    dynamics, response = simulation.dynamics, simulation.response
    columns = [response.lags]
    settled = [np.full(response.lags.shape[1], simulation.settled)]
    for i, (omega, damping, *_) in enumerate(layout.of_modes(theta)):
        state, change = response.modes[:, i], dynamics.weights[i] * response.changes[:, i]
        pole = dynamics.poles[i]
        turned = omega * damping * (1.0 + 1j * damping / np.sqrt(1.0 - damping**2))
        moved = [(change * pole).real, (change * turned).real, state.real, -state.imag]
        columns.append(np.column_stack(moved))
        settled.append(np.array([0.0, 0.0, simulation.settled, 0.0]))
    slow = (-1.0 / layout.time_constants).astype(np.complex128)
    bank = slow, dynamics.gains.astype(np.complex128)
    creep = HeldFilter(bank, 1.0, record.length, record.block, np.concatenate(settled))
    return creep(np.hstack(columns))
