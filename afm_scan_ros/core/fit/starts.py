"""A fit in which records begin at depolarised rest in place of a start that nobody knows."""

from collections.abc import Collection

import numpy as np
from attrs import evolve

from afm_scan_ros.core.fit.estimator import AxisFit


def begun_at_rest(fit: AxisFit, places: Collection[int]) -> AxisFit:
    """Return a fit in which some records rested before their first sample, at 0 V.

    They remember nothing then, and no creep goes on in them.
    """
    records, memories = [], [np.zeros(0)]
    for k, record in enumerate(fit.records):
        changed = record
        if k in places:
            changed = evolve(record, rested=True, unknown=None)
        elif record.unknown is not None:
            changed = evolve(record, unknown=len(memories) - 1)
            memories.append(fit.theta[fit.layout.memory_part(record)])
        records.append(changed)
    layout = evolve(fit.layout, unknown_starts=len(memories) - 1)
    theta = np.concatenate([fit.theta[: layout.parts["memory"].start], *memories])
    return AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)


def counted_from_rest(fit: AxisFit) -> AxisFit:
    """Return a fit in which records that rested at first count from their first sample on."""
    records = [evolve(one, first=0) if one.rested else one for one in fit.records]
    return AxisFit(fit.layout, records, fit.gain, fit.theta, fit.discrepancy, fit.scales)
