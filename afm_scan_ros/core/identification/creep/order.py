"""How many springs and dampers a creep record shows, judged on a part of it that fitted nothing."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.identification.creep.series import Series, grow, spring
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.types import Array

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
