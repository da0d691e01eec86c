"""A hysteresis record → its first-order reversal curves, each a rise from saturation and a return.

Their turning points are read from the recorded drive, so that a record made elsewhere serves too.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

ON_LEVEL = 1e-3
"""Share of the spacing of the levels by which a turning point may miss its level."""


@frozen(eq=False)
class ReversalCurves:
    """Curves that turn at equally spaced drive levels, and what lies after the last of them.

    ``levels`` (n,) V, from negative saturation to positive; curve i turns at ``levels[i + 1]``.
    ``peaks`` (n - 1,) and ``returned`` (n - 1,) are the samples where it turns and where it is
    back at saturation; ``end`` is the sample after the last curve.
    """

    levels: Array
    peaks: NDArray[np.int64]
    returned: NDArray[np.int64]
    end: int


def reversal_curves(drive: Array) -> ReversalCurves:
    """Find the curves in a drive (V), shape (n,).

    Raises InputError unless their turning points are equally spaced and none is missing.
    """
    turns = turning_points(drive)
    bottom = drive.min()
    near = ON_LEVEL * np.ptp(drive)
    saturated = drive[turns] <= bottom + near
    inner = np.flatnonzero(saturated[:-2] & ~saturated[1:-1] & saturated[2:])
    peaks, returned = turns[inner + 1], turns[inner + 2]
    if len(peaks) == 0:
        raise InputError(
            "hysteresis record: no curve rises from negative saturation and returns to it;"
            " drive first-order reversal curves"
        )
    order = np.argsort(drive[peaks])
    levels = np.linspace(bottom, drive.max(), len(peaks) + 1)
    missed = np.abs(drive[peaks][order] - levels[1:]) > ON_LEVEL * (levels[1] - levels[0])
    if missed.any():
        level = levels[1:][missed][0]
        raise InputError(
            f"hysteresis record: {len(peaks)} curves, none of which turns at {level:.4g} V;"
            " let them turn once at each of equally spaced levels up to positive saturation"
        )
    return ReversalCurves(levels, peaks[order], returned[order], int(returned.max()))


def turning_points(drive: Array) -> NDArray[np.int64]:
    """Samples where the drive turns round, the first of each where it pauses there."""
    moving = np.flatnonzero(np.diff(drive))
    rising = np.diff(drive)[moving] > 0.0
    return np.asarray(moving[:-1][rising[:-1] != rising[1:]] + 1, dtype=np.int64)
