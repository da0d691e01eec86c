"""Springs and dampers in series (Eq. 1): fitted to a creep record, their number and intervals.

The origin, the first step's height and the gains enter linearly, so they follow by linear least
squares from what does not: the time constants, and the later steps' heights against the first,
which the hysteresis sets and which are nuisances here.

Intervals: a parameter is moved from its best value, all others are fitted anew, and the 95 %
interval ends where the squared error has grown by t² s²: s² is the error's variance for as many
stretches as are left over, t Student's quantile (Bates & Watts, Nonlinear Regression Analysis,
1988, ch. 6). The noise is taken as white, its size from the fit itself.

Number: the series is chosen on a part of the record held out of the fit.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares
from scipy.stats import t as student

from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.types import Array

FASTEST, SLOWEST = 0.1, 100.0
"""Time constants looked for: from this, in s, to this, in lengths of the longest hold."""
LEAST, MOST = 0.2, 5.0
"""Bounds of a later step's displacement per volt against the first's."""
SEEDS, TRIED = 12, 3
"""Time constants at which one more element is begun, and how many, the best, are refined."""


@frozen(eq=False)
class CreepSeries:
    """Origin (m), slope of each step (m/V), gains and time constants (s) of each element.

    ``cost`` is the sum of squared errors (m²), a sample counting one.
    """

    origin: float
    slopes: Array
    gains: Array
    time_constants: Array
    cost: float

    def predict(self, record: CreepRecord) -> Array:
        """Displacement, m, of each stretch of a record that has as many steps."""
        columns = _columns(record, self.time_constants, self.slopes)
        return np.asarray(self.origin + columns[:, 1] + columns[:, 2:] @ self.gains)

    def extended(self, record: CreepRecord) -> "CreepSeries":
        """Return the series with the slope of a record's last step, where it has one more.

        Only that slope is fitted to the record, by linear least squares.
        """
        if len(record.steps) == len(self.slopes):
            return self
        unit = evolve(self, origin=0.0, slopes=np.append(0.0 * self.slopes, 1.0)).predict(record)
        without = evolve(self, slopes=np.append(self.slopes, 0.0)).predict(record)
        slope = unit @ (record.displacement - without) / (unit @ unit)
        return evolve(self, slopes=np.append(self.slopes, slope))


@frozen
class Held:
    """A parameter held at a value: ``"gain"`` or ``"time_constant"`` of an element."""

    parameter: str
    element: int
    value: float


@frozen(eq=False)
class _Projection:
    """The least squares that is left when the linear parameters follow from the others.

    Those others are log τ of each element and each later step's slope against the first's.
    """

    record: CreepRecord
    order: int
    held: Held | None

    def parameters(self, series: CreepSeries) -> Array:
        """Return the parameters of a series, within bounds; a step it lacks has the first's."""
        later = np.ones(len(self.record.steps) - 1)
        later[: len(series.slopes) - 1] = series.slopes[1:] / series.slopes[0]
        low, high = self.bounds()
        parameters = np.append(np.log(series.time_constants), later)
        return np.asarray(np.clip(parameters, low + 1e-10, high - 1e-10))

    def columns(self, parameters: Array) -> Array:
        """Weighed responses, a column for each linear parameter; a held gain is within spring's."""
        ratios = np.append(1.0, parameters[self.order :])
        columns = _columns(self.record, np.exp(parameters[: self.order]), ratios)
        if self.held and self.held.parameter == "gain":
            columns[:, 1] += self.held.value * columns[:, 2 + self.held.element]
            columns = np.delete(columns, 2 + self.held.element, axis=1)
        return columns * np.sqrt(self.record.count)[:, np.newaxis]

    @property
    def target(self) -> Array:
        """Weighed displacement, m."""
        return np.asarray(self.record.displacement * np.sqrt(self.record.count))

    def residual(self, parameters: Array) -> Array:
        """What no choice of the linear parameters explains, m."""
        base, _ = np.linalg.qr(self.columns(parameters))
        return np.asarray(self.target - base @ (base.T @ self.target))

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest parameters; a held time constant has next to no room."""
        later = len(self.record.steps) - 1
        low = np.log(np.full(self.order, FASTEST))
        high = np.log(np.full(self.order, SLOWEST * self.record.longest))
        if self.held and self.held.parameter == "time_constant":
            low[self.held.element] = np.log(self.held.value) - 1e-9
            high[self.held.element] = np.log(self.held.value) + 1e-9
        return np.append(low, np.full(later, LEAST)), np.append(high, np.full(later, MOST))

    def solve(self, parameters: Array) -> CreepSeries:
        """Return the series with the linear parameters that fit best."""
        columns = self.columns(parameters)
        weights = np.linalg.lstsq(columns, self.target, rcond=None)[0]
        gains = weights[2:] / weights[1]
        if self.held and self.held.parameter == "gain":
            gains = np.insert(gains, self.held.element, self.held.value)
        slopes = weights[1] * np.append(1.0, parameters[self.order :])
        cost = float(np.sum((self.target - columns @ weights) ** 2))
        return CreepSeries(float(weights[0]), slopes, gains, np.exp(parameters[: self.order]), cost)


def spring() -> CreepSeries:
    """Return the series without an element, where every fit begins."""
    return CreepSeries(0.0, np.ones(1), np.empty(0), np.empty(0), np.inf)


def refine(record: CreepRecord, start: CreepSeries, held: Held | None = None) -> CreepSeries:
    """Fit a series of as many elements, from ``start`` to where the squared error is least."""
    problem = _Projection(record, len(start.time_constants), held)
    begin = problem.parameters(start)
    scale = np.linalg.norm(problem.residual(begin))
    found = least_squares(lambda p: problem.residual(p) / scale, begin, bounds=problem.bounds())
    return problem.solve(found.x)


def grow(record: CreepRecord, smaller: CreepSeries) -> CreepSeries:
    """Fit a series of one element more, the best of those begun at several time constants.

    The elements come out in order of their time constants.
    """
    seeds = np.geomspace(3.0 * FASTEST, record.longest, SEEDS)
    constants = (np.append(smaller.time_constants, seed) for seed in seeds)
    problem = _Projection(record, len(smaller.time_constants) + 1, None)
    begun = [evolve(smaller, time_constants=each) for each in constants]
    begun.sort(key=lambda each: np.linalg.norm(problem.residual(problem.parameters(each))))
    best = min((refine(record, each) for each in begun[:TRIED]), key=lambda series: series.cost)
    order = np.argsort(best.time_constants)
    return evolve(best, gains=best.gains[order], time_constants=best.time_constants[order])


def _columns(record: CreepRecord, time_constants: Array, slopes: Array) -> Array:
    """Responses to a constant, and of the spring and of each element to all steps, (n, 2 + m)."""
    first, count = record.first, record.count
    columns = np.zeros((len(first), 2 + len(time_constants)))
    columns[:, 0] = 1.0
    for step, slope in zip(record.steps, slopes, strict=True):
        height = slope * step.height
        columns[:, 1] += height * step.made(first)
        for i, tau in enumerate(time_constants):
            columns[:, 2 + i] += height * step.lagged(first, count, record.sample_period / tau)
    return columns


LEVEL = 0.95
FIRST_STRIDE = 0.01
"""First distance tried from the best value, relative; each next one is twice as far."""
FARTHEST = np.log(1e3)
"""Logarithm of the factor at which an interval that has not closed counts as open."""

Interval = tuple[float, float]


def intervals(record: CreepRecord, best: CreepSeries) -> Mapping[str, Interval]:
    """95 % interval of ``gain_1``, ``time_constant_1`` (s), …, elements counted from the fastest.

    ``record`` is the averaged one that ``best`` was fitted to. An open interval ends at 0 or inf.
    A gain grows with its time constant without end, so it is open where that one is.
    """
    found: dict[str, Interval] = {}
    for element, (gain, tau) in enumerate(zip(best.gains, best.time_constants, strict=True)):
        slowest = np.log(SLOWEST * record.longest / tau)
        constant = _Profile(record, best, "time_constant", element)
        low, high = constant.end(-1.0, np.log(tau / FASTEST)), constant.end(1.0, slowest)
        profile = _Profile(record, best, "gain", element)
        farthest = FARTHEST if np.isfinite(high) else 0.0
        ends = gain * profile.end(-1.0, FARTHEST), gain * profile.end(1.0, farthest)
        found[f"gain_{element + 1}"] = float(min(ends)), float(max(ends))
        found[f"time_constant_{element + 1}"] = float(tau * low), float(tau * high)
    return found


class _Profile:
    """The growth of the squared error along one parameter, over what 95 % allow, less one."""

    def __init__(
        self, record: CreepRecord, best: CreepSeries, parameter: str, element: int
    ) -> None:
        free = len(record.first) - 1 - 2 * len(best.gains) - len(best.slopes)
        quantile = float(student.ppf(0.5 + LEVEL / 2.0, free))
        self._allowed = quantile**2 * best.cost / free
        self._record, self._best, self._last = record, best, best
        self._parameter, self._element = parameter, element
        self._value = {"gain": best.gains, "time_constant": best.time_constants}[parameter][element]

    def _growth(self, logarithm: float) -> float:
        held = Held(self._parameter, self._element, self._value * np.exp(logarithm))
        self._last = refine(self._record, self._last, held)
        return (self._last.cost - self._best.cost) / self._allowed - 1.0

    def end(self, direction: float, farthest: float) -> float:
        """Return the factor on the best value where 95 % end, in one direction (±1).

        It is 0 or inf where they do not end within a factor of exp(±farthest).
        """
        self._last = self._best
        before, stride, known = 0.0, FIRST_STRIDE, {0.0: -1.0}
        while stride < farthest:
            known[stride] = self._growth(direction * stride)
            if known[stride] > 0.0:
                return float(np.exp(direction * self._root(direction, before, stride, known)))
            before, stride = stride, 2.0 * stride
        return np.inf if direction > 0.0 else 0.0

    def _root(
        self, direction: float, before: float, after: float, known: Mapping[float, float]
    ) -> float:
        """Find the end between two values whose growth is ``known``.

        A fit starts at the one before it, so that it need not end twice at the same value.
        """

        def growth(distance: float) -> float:
            return known[distance] if distance in known else self._growth(direction * distance)

        return float(brentq(growth, before, after, xtol=1e-5))


MATERIAL = 0.02
STANDARD_ERRORS = 2.0
HELD_OUT = 0.25
"""Share of a single hold, its end, that is held out; of several holds it is the last."""


@frozen(eq=False)
class OrderTried:
    """A series fitted to the fitted part alone; misfits in m, sample by sample (Eqs. 2, 3)."""

    series: CreepSeries
    fitted: Misfit
    held_out: Misfit
    error: Array
    """Held-out error, m, sample by sample."""

    @property
    def order(self) -> int:
        """Number of springs and dampers in series."""
        return len(self.series.gains)


def try_orders(record: CreepRecord, highest: int) -> tuple[OrderTried, ...]:
    """Fit orders 1 to ``highest`` to the fitted part of a record, and predict what is held out."""
    held_out = _held_out(record)
    fitting, fresh = record.where(~held_out), record.where(held_out)
    averaged, series, tried = fitting.averaged(), spring(), list[OrderTried]()
    for _ in range(highest):
        series = grow(averaged, series)
        tried.append(_tried(series, fitting, fresh))
    return tuple(tried)


def choose(tried: Sequence[OrderTried]) -> OrderTried:
    """Return the smallest order with positive gains that predicts the held-out part as the best.

    An order is worse where its error is larger by more than ``MATERIAL`` and by more than
    ``STANDARD_ERRORS`` of the difference. Where every order has a negative gain, the smallest.
    """
    possible = [each for each in tried if min(each.series.gains) > 0.0]
    if not possible:
        return tried[0]
    best = min(possible, key=lambda each: each.held_out.sigma)
    return next(each for each in possible if not _worse(each, best))


def _worse(one: OrderTried, other: OrderTried) -> bool:
    excess = one.error**2 - other.error**2
    chance = STANDARD_ERRORS * float(np.std(excess)) / np.sqrt(len(excess))
    material = one.held_out.sigma > (1.0 + MATERIAL) * other.held_out.sigma
    return material and float(np.mean(excess)) > chance


def _held_out(record: CreepRecord) -> NDArray[np.bool_]:
    last = record.hold == record.hold[-1]
    if record.hold[-1] > 1:
        return np.asarray(last)
    begin, end = record.first[last][[0, -1]]
    return np.asarray(last & (record.first >= end - HELD_OUT * (end - begin)))


def _tried(series: CreepSeries, fitting: CreepRecord, fresh: CreepRecord) -> OrderTried:
    error = fresh.displacement - series.extended(fresh).predict(fresh)
    return OrderTried(
        series,
        misfit(fitting.displacement - series.predict(fitting)),
        misfit(error),
        error,
    )
