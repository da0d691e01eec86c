"""What a drive is for, told from its shape alone, whatever its size and its sample period."""

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ON_SATURATION,
    reversal_curves,
)
from afm_scan_ros.core.identification.vibration.periodic import repetition
from afm_scan_ros.core.identification.vibration.swept import is_sweep
from afm_scan_ros.core.types import Array

RESTING = 0.5
"""Share of its samples that a drive rests in, beyond which it steps from hold to hold."""
TURNS = 3
"""Levels at which reversal curves turn, at least: a sine of one amplitude has two."""


def recognised(drive: Array) -> str | None:
    """Tell a drive (V), (n,), for creep, frequency or hysteresis; None where it is none of these.

    Steps between holds show creep, two equal periods in succession or a sweep the frequency
    response, reversal curves hysteresis.
    """
    if np.mean(np.diff(drive) == 0.0) > RESTING:
        return "creep"
    if _reverses(drive):
        return "hysteresis"
    return "frequency" if _repeats(drive) or is_sweep(drive) else None


def _reverses(drive: Array) -> bool:
    try:
        curves = reversal_curves(drive)
    except InputError:
        return False
    turns = np.sort(drive[np.concatenate([curves.falling, curves.rising])[:, 0]])
    apart = np.diff(turns) > ON_SATURATION * np.ptp(drive)
    return int(np.count_nonzero(apart)) + 1 >= TURNS


def _repeats(drive: Array) -> bool:
    period = repetition(drive[:, np.newaxis])
    count = len(drive) // period if period else 0
    pieces = drive[: count * period].reshape(count, -1)
    return bool(count > 1 and np.any(np.all(pieces[1:] == pieces[:-1], axis=1)))
