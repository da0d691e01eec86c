"""How many springs and dampers a creep record shows, judged on a part of it that fitted nothing."""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.identification.creep_record import CreepRecord
from afm_scan_ros.core.identification.creep_series import Series, grow, spring
from afm_scan_ros.core.identification.recording import Misfit, misfit
from afm_scan_ros.core.types import Array

CRITERION = (
    "the smallest order whose held-out error is no worse than any other's by more than 2 % and by"
    " two standard errors of the difference, among the orders of which every gain is positive"
)
MATERIAL = 0.02
STANDARD_ERRORS = 2.0
HELD_OUT = 0.25
"""Share of a single hold, its end, that is held out; of several holds it is the last."""


@frozen(eq=False)
class OrderTried:
    """A series fitted to the fitted part alone; misfits in m, sample by sample (Eqs. 2, 3)."""

    order: int
    gains: tuple[float, ...]
    time_constants: tuple[float, ...]
    """In s, ascending."""
    fitted: Misfit
    held_out: Misfit
    error: Array
    """Held-out error, m, sample by sample."""


def try_orders(record: CreepRecord, orders: Sequence[int]) -> tuple[OrderTried, ...]:
    """Fit each order to the fitted part of a record, and predict what is held out."""
    held_out = _held_out(record)
    fitting, fresh = record.where(~held_out), record.where(held_out)
    return tuple(
        _tried(series, fitting, fresh)
        for series in all_orders(fitting.averaged(), max(orders))
        if len(series.gains) in orders
    )


def all_orders(record: CreepRecord, highest: int) -> Iterator[Series]:
    """Fit orders 1 to ``highest``, each begun from the one before."""
    series = spring()
    for _ in range(highest):
        series = grow(record, series)
        yield series


def choose(tried: Sequence[OrderTried]) -> OrderTried:
    """Return the order that ``CRITERION`` names; of negative gains everywhere, the smallest."""
    possible = [each for each in tried if min(each.gains) > 0.0]
    if not possible:
        return tried[0]
    best = min(possible, key=lambda each: each.held_out.sigma)
    return next(each for each in possible if not _worse(each, best))


def _worse(one: OrderTried, other: OrderTried) -> bool:
    excess = one.error**2 - other.error**2
    chance = STANDARD_ERRORS * float(np.std(excess)) / np.sqrt(len(excess))
    material = one.held_out.sigma > (1.0 + MATERIAL) * other.held_out.sigma
    return material and float(np.mean(excess)) > chance


def _held_out(record: CreepRecord) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    last = record.hold == record.hold[-1]
    if record.hold[-1] > 1:
        return np.asarray(last)
    begin, end = record.first[last][[0, -1]]
    return np.asarray(last & (record.first >= end - HELD_OUT * (end - begin)))


def _tried(series: Series, fitting: CreepRecord, fresh: CreepRecord) -> OrderTried:
    error = fresh.displacement - series.extended(fresh).predict(fresh)
    return OrderTried(
        len(series.gains),
        tuple(series.gains.tolist()),
        tuple(series.time_constants.tolist()),
        misfit(fitting.displacement - series.predict(fitting)),
        misfit(error),
        error,
    )
