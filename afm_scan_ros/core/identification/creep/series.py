"""Springs and dampers in series (Eq. 1), fitted to a creep record by variable projection.

The origin, the first step's height and the gains enter linearly, so they follow by linear least
squares from what does not: the time constants, and the later steps' heights against the first,
which the hysteresis sets and which are nuisances here.
"""

import numpy as np
from attrs import evolve, frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.types import Array

FASTEST, SLOWEST = 0.1, 100.0
"""Time constants looked for: from this, in s, to this, in lengths of the longest hold."""
LEAST, MOST = 0.2, 5.0
"""Bounds of a later step's displacement per volt against the first's."""
SEEDS, TRIED = 12, 3
"""Time constants at which one more element is begun, and how many, the best, are refined."""


@frozen(eq=False)
class Series:
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

    def extended(self, record: CreepRecord) -> "Series":
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

    def parameters(self, series: Series) -> Array:
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

    def solve(self, parameters: Array) -> Series:
        """Return the series with the linear parameters that fit best."""
        columns = self.columns(parameters)
        weights = np.linalg.lstsq(columns, self.target, rcond=None)[0]
        gains = weights[2:] / weights[1]
        if self.held and self.held.parameter == "gain":
            gains = np.insert(gains, self.held.element, self.held.value)
        slopes = weights[1] * np.append(1.0, parameters[self.order :])
        cost = float(np.sum((self.target - columns @ weights) ** 2))
        return Series(float(weights[0]), slopes, gains, np.exp(parameters[: self.order]), cost)


def spring() -> Series:
    """Return the series without an element, where every fit begins."""
    return Series(0.0, np.ones(1), np.empty(0), np.empty(0), np.inf)


def refine(record: CreepRecord, start: Series, held: Held | None = None) -> Series:
    """Fit a series of as many elements, from ``start`` to where the squared error is least."""
    problem = _Projection(record, len(start.time_constants), held)
    begin = problem.parameters(start)
    scale = np.linalg.norm(problem.residual(begin))
    found = least_squares(lambda p: problem.residual(p) / scale, begin, bounds=problem.bounds())
    return problem.solve(found.x)


def grow(record: CreepRecord, smaller: Series) -> Series:
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
