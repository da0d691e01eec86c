"""Whether the records are of one scanner, and enough of it."""

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.hysteresis.fresh_loops import can_judge
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ReversalCurves,
)

LIKE_GAINS = (0.5, 2.0)
"""Gain of the frequency over that of the hysteresis record, beyond which they are not of one."""


def loops_after(hysteresis: AxisRecord, curves: ReversalCurves) -> bool:
    """Whether loops follow the reversal curves, to judge the fit by."""
    return can_judge(hysteresis.drive[curves.end :])


def refuse_unlike(creep: AxisRecord, frequency: AxisRecord, hysteresis: AxisRecord) -> None:
    """Refuse records of unlike drives.

    Raises InputError, which names the record and what to record instead.
    """
    within = np.abs(hysteresis.drive).max()
    for name, record in (("creep", creep), ("frequency", frequency)):
        asked = np.abs(record.drive).max()
        if asked > within:
            raise InputError(
                f"{name} record: its drive reaches {asked:.4g} V, that of the hysteresis record"
                f" only {within:.4g} V; record both in volts, the {name} at a smaller drive"
            )


def refuse_other_gain(ratio: float) -> None:
    """Refuse a gain (1) of the frequency over the hysteresis record that no one scanner has.

    Raises InputError.
    """
    if not LIKE_GAINS[0] <= ratio <= LIKE_GAINS[1]:
        raise InputError(
            f"frequency record: it shows {ratio:.4g} times the gain of the hysteresis record;"
            " they are of different axes, scanners, units or signs: record both anew"
        )
