"""Fits whose records begin at depolarised rest, or each from a start of its own."""

from collections.abc import Collection, Sequence
from itertools import count

import numpy as np
from attrs import evolve

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.types import Array


def begun_at_rest(fit: AxisFit, places: Collection[int]) -> AxisFit:
    """Return a fit in which some records rested before their first sample, at 0 V.

    They remember nothing then, no creep goes on in them, and they count from their first sample on.
    """
    records, memories = [], [np.zeros(0)]
    for k, record in enumerate(fit.records):
        changed = record
        if k in places:
            changed = evolve(record, rested=True, unknown=None, first=0)
        elif record.unknown is not None:
            changed = evolve(record, unknown=len(memories) - 1)
            memories.append(fit.theta[fit.layout.memory_part(record)])
        records.append(changed)
    layout = evolve(fit.layout, unknown_starts=len(memories) - 1)
    theta = np.concatenate([fit.theta[: layout.parts["memory"].start], *memories])
    theta[layout.parts["rest"]] = rest_of(fit)
    return AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)


def rest_of(fit: AxisFit) -> Array:
    """Where a fit's operator lies at depolarised rest, in θ: as records, or else itself, tell."""
    if any(one.rested for one in fit.records):
        return fit.theta[fit.layout.parts["rest"]]
    return fit.layout.operator.depolarised(fit.layout.of_operator(fit.theta))


def each_of_own_start(records: Sequence[Signals]) -> list[Signals]:
    """Return records of which each that did not begin at rest has an unknown start of its own."""
    places = count()
    return [one if one.rested else evolve(one, unknown=next(places)) for one in records]


def counted_whole(fit: AxisFit) -> AxisFit:
    """Return a fit of which each record counts from its first sample on."""
    records = [evolve(one, first=0) for one in fit.records]
    return AxisFit(fit.layout, records, fit.gain, fit.theta, fit.discrepancy, fit.scales)


def evidence_left_out(fit: AxisFit) -> float:
    """Evidence (nat) of the samples that are left out as what came before them is unknown.

    It is the greatest that they can have: the model leaves no more of them than of the others, and
    the memory has the volume that these samples leave of what is expected of it.
    """
    early = [k for k, one in enumerate(fit.records) if one.first]
    places = {k: place for place, k in enumerate(early)}
    records = [evolve(one, first=0, unknown=places.get(k)) for k, one in enumerate(fit.records)]
    operator = fit.layout.operator
    layout = evolve(fit.layout, unknown_starts=len(early))
    kept = fit.theta[: layout.parts["memory"].start]
    theta = np.concatenate([kept, np.zeros(len(early) * operator.unknowns)])
    whole = AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)
    memory = layout.parts["memory"]
    matrix = whole.normal(with_operator=False)[0][memory, memory]
    expected = np.tile(operator.expected_memory(), len(early))
    volume = np.linalg.slogdet(np.eye(len(expected)) + expected[:, np.newaxis] * matrix * expected)
    lost = 0.0
    for all_of_it, one, left in zip(records, fit.records, fit.residuals(), strict=True):
        variance = fit.variance(one)
        each = np.log(variance) + float(np.mean(left**2)) / variance
        lost += (len(all_of_it.mean) - len(one.mean)) * each
    return float(-0.5 * (lost + volume[1]))
