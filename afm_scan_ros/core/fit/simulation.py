"""A record as a model would have moved in it, and its derivatives averaged over stretches.

From A = F + Σ c_j q_j(F), the map behind the operator, follow ∂F/∂A = 1 / (dA/dF) and
∂F/∂c_j = -q_j(F) / (dA/dF). These pass V, C and M as inputs known over stretches.
"""

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.hysteresis.preisach import terms
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.dynamics import (
    PoleBank,
    Response,
    States,
    of_modes,
    respond,
)
from afm_scan_ros.core.fit.parameters import Columns, Layout
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.fit.stretches import StretchFilter, averaged, means
from afm_scan_ros.core.types import Array, Complex


@frozen(eq=False)
class Simulation:
    """A record at θ: effective input F (V), (n,), and the response for a gain of 1.

    The scanner had settled under the input ``settled`` (V).
    """

    layout: Layout
    theta: Array
    record: Signals
    effective: Array
    settled: float
    dynamics: PoleBank

    @cached_property
    def response(self) -> Response:
        """Response to F, sample by sample."""
        return self.responding(self.theta)

    def responding(self, theta: Array, later: float = 0.0) -> Response:
        """Return the response to the same F of V, C and M at some θ, read so much (s) ``later``.

        Raises InputError where the sensor is ahead of a drive that is late, by a sample or more.
        """
        layout, record = self.layout, self.record
        late = later + layout.delay_of(theta) - record.late * record.period
        if late <= -record.period:
            raise InputError(f"{record.name}: the delay of the fit is {late:.3g} s")
        return respond(layout.dynamics(theta), record.period, self.effective, self.settled, late)

    @cached_property
    def output(self) -> Array:
        """Means of the response over blocks, (blocks,)."""
        return averaged(self.response.output, self.record.block)

    @cached_property
    def states(self) -> States:
        """What the derivatives of the response hold."""
        return self.response.states(self.record.edges)

    @cached_property
    def slopes(self) -> Array:
        """dA/dF averaged over stretches, (stretches,)."""
        effective, mapped = means(self.effective, self.record.edges), self.layout.map_of(self.theta)
        return np.ones_like(effective) if mapped is None else mapped.slope(effective)

    @cached_property
    def bends(self) -> Array:
        """Means of the map's terms q_j(F) over stretches, (stretches, terms)."""
        operator = self.layout.operator
        every = terms(self.effective, operator.lower, operator.upper, operator.bends)
        return means(every, self.record.edges)

    @cached_property
    def remembered(self) -> Array:
        """∂A/∂(where the record begins) averaged over stretches, (stretches, unknowns)."""
        layout, record = self.layout, self.record
        start = layout.start_of(self.theta, record)
        if not start[1].shape[1]:
            return np.zeros((len(record.edges) - 1, 0))
        given = layout.of_operator(self.theta), record.drive, record.edges
        return layout.operator.remembered(*given, start)

    @cached_property
    def vibration(self) -> Array:
        """Derivatives of all stretches by the weights of the lags, and by what θ has of modes."""
        dynamics = self.dynamics
        modes, changes, lags = dynamics.seen(self.states)
        columns, settled = [lags], [np.full(lags.shape[1], self.settled)]
        for i, (omega, damping, *_) in enumerate(self.layout.of_modes(self.theta)):
            state, change = modes[:, i], dynamics.weights[i] * changes[:, i]
            pole = dynamics.poles[i]
            turned = omega * damping * (1.0 + 1j * damping / np.sqrt(1.0 - damping**2))
            moved = [(change * pole).real, (change * turned).real, state.real, -state.imag]
            columns.append(np.column_stack(moved))
            settled.append(np.array([0.0, 0.0, self.settled, 0.0]))
        return self._crept(np.hstack(columns), np.concatenate(settled))

    def by_weights(self, poles: Complex) -> Array:
        """Derivatives of all stretches by the weights of modes that the model lacks.

        Those by Re κ and Im κ of each pole (rad/s), (n,), stand side by side: (stretches, 2 n).
        """
        tried = evolve(self.dynamics, poles=poles, weights=np.zeros(len(poles), complex))
        given = self.record.period, self.settled, self.effective, self.record.edges
        modes, changes = of_modes(tried.read(), *given)
        none = np.zeros((len(modes), 0))
        seen, _, _ = tried.seen(States(modes, changes, none, none))
        columns = np.stack([seen.real, -seen.imag], axis=2).reshape(len(seen), -1)
        return self._crept(columns, np.tile([self.settled, 0.0], len(poles)))

    def _crept(self, columns: Array, settled: Array) -> Array:
        """What creep makes of columns (stretches, n) that had settled."""
        slow = (-1.0 / self.layout.time_constants).astype(np.complex128)
        bank = slow, self.dynamics.gains.astype(np.complex128)
        return StretchFilter(bank, 1.0, self.record.period, self.record.edges, settled)(columns)

    @cached_property
    def sensed(self) -> Array:
        """Derivatives by what θ has of the sensor, (stretches, parameters), by differences.

        They are those by the logarithm of its corner and by its delay, as far as it has them.
        """
        columns = np.zeros((len(self.record.edges) - 1, 0))
        apart = float(np.cbrt(np.finfo(float).eps))
        if self.layout.sensor_order:
            step = np.zeros(self.layout.size)
            step[self.layout.parts["sensor"].start] = apart
            ends = [self.responding(self.theta + way * step).output for way in (1.0, -1.0)]
            columns = np.column_stack([columns, self._change(*ends) / (2.0 * apart)])
        if self.layout.delayed:
            apart *= self.record.period
            later = self.responding(self.theta, apart).output
            columns = np.column_stack([columns, self._change(later, self.response.output) / apart])
        return columns

    def _change(self, one: Array, other: Array) -> Array:
        return means(one - other, self.record.edges)


def simulate(layout: Layout, theta: Array, record: Signals) -> Simulation:
    """Simulate a record exactly.

    Raises InputError where the map behind the operator turns back, or a mode does not oscillate.
    """
    operator, mapped = layout.of_operator(theta), layout.map_of(theta)
    before = np.zeros(1) if record.rested else record.drive[:1]
    start, _ = layout.start_of(theta, record)
    raw, rest = (layout.operator.output(operator, one, start) for one in (record.drive, before))
    if mapped is not None:
        raw, rest = mapped.output(raw), mapped.output(rest)
    return Simulation(layout, theta, record, raw, float(rest[0]), layout.dynamics(theta))


def at_rest(layout: Layout, theta: Array) -> Array:
    """F (V) at depolarised rest, shape (1,)."""
    start, mapped = layout.at_rest(theta)[0], layout.map_of(theta)
    at = layout.operator.output(layout.of_operator(theta), np.zeros(1), start)
    return at if mapped is None else mapped.output(at)


def by_rest(layout: Layout, theta: Array) -> Array:
    """Derivatives of F at depolarised rest by the operator, its map, and where that rest is."""
    operator, given, rest = layout.operator, layout.of_operator(theta), np.zeros(1)
    mapped, at, start = layout.map_of(theta), at_rest(layout, theta), layout.at_rest(theta)
    (columns,) = operator.pieces(given, rest, np.arange(2), start[0])
    bends = terms(at, operator.lower, operator.upper, operator.bends)
    slope = 1.0 if mapped is None else mapped.slope(at)[0]
    moved = operator.remembered(given, rest, np.arange(2), start)
    return np.asarray(np.concatenate([columns[0], -bends[0], moved[0]]) / slope)


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
