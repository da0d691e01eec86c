"""Profile-likelihood intervals of a creep series: how far each parameter may go before it shows.

A parameter is moved from its best value, all others are fitted anew, and the 95 % interval ends
where the squared error has grown by t² s²: s² is the error's variance for as many stretches as are
left over, t Student's quantile (Bates & Watts, Nonlinear Regression Analysis, 1988, ch. 6). The
noise is taken as white, its size from the fit itself.

How many springs and dampers a creep record shows, judged on a part of it held out of the fit.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import t as student

from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.identification.creep.series import (
    FASTEST,
    SLOWEST,
    Held,
    Series,
    grow,
    refine,
    spring,
)
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.types import Array

LEVEL = 0.95
FIRST_STRIDE = 0.01
"""First distance tried from the best value, relative; each next one is twice as far."""
FARTHEST = np.log(1e3)
"""Logarithm of the factor at which an interval that has not closed counts as open."""

Interval = tuple[float, float]


def intervals(record: CreepRecord, best: Series) -> Mapping[str, Interval]:
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

    def __init__(self, record: CreepRecord, best: Series, parameter: str, element: int) -> None:
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

    series: Series
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


def _tried(series: Series, fitting: CreepRecord, fresh: CreepRecord) -> OrderTried:
    error = fresh.displacement - series.extended(fresh).predict(fresh)
    return OrderTried(
        series,
        misfit(fitting.displacement - series.predict(fitting)),
        misfit(error),
        error,
    )
