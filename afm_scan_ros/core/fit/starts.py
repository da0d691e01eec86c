"""A fit in which records begin at depolarised rest in place of a start that nobody knows."""

from collections.abc import Collection

import numpy as np
from attrs import evolve

from afm_scan_ros.core.fit.estimator import AxisFit


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
    return AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)


def evidence_left_out(fit: AxisFit) -> float:
    """Evidence (nat) of the samples that are left out as what came before them is unknown.

    It is the greatest that they can have: the model leaves no more of them than of the others, and
    the memory has the volume that these samples leave of what is expected of it.
    """
    early = [k for k, one in enumerate(fit.records) if one.first]
    places = {k: place for place, k in enumerate(early)}
    records = [evolve(one, first=0, unknown=places.get(k)) for k, one in enumerate(fit.records)]
    count, operator = len(early), fit.layout.operator
    layout = evolve(fit.layout, unknown_starts=count)
    kept = fit.theta[: layout.parts["memory"].start]
    theta = np.concatenate([kept, np.zeros(count * operator.unknowns)])
    whole = AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)
    memory = layout.parts["memory"]
    matrix = whole.normal(with_operator=False)[0][memory, memory]
    expected = np.tile(operator.expected_memory(), count)
    volume = np.linalg.slogdet(np.eye(len(expected)) + expected[:, np.newaxis] * matrix * expected)
    lost = 0.0
    for all_of_it, one, left in zip(records, fit.records, fit.residuals(), strict=True):
        variance = fit.variance(one)
        each = np.log(variance) + float(np.mean(left**2)) / variance
        lost += (len(all_of_it.mean) - len(one.mean)) * each
    return float(-0.5 * (lost + volume[1]))
