"""A record that flattens towards the ends of its drive: an amplifier or a stage at its limit."""

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

END, FLAT = 0.05, 0.5
"""A record saturates where its slope in this share at an end is below this share of the mean."""


def refuse_saturated(name: str, axis: str, drive: Array, displacement: Array) -> None:
    """Raise InputError where a slow record, (n,) in V and m, flattens towards an end of its drive.

    Hysteresis steepens a loop towards its ends; an amplifier or a stage at its limit flattens it.
    """
    move, follow = np.diff(drive), np.diff(displacement)
    near = END * np.ptp(drive)
    ends = {
        "top": (move > 0.0) & (drive[1:] > drive.max() - near),
        "bottom": (move < 0.0) & (drive[1:] < drive.min() + near),
    }
    for end, there in ends.items():
        same_way = move * np.sign(move[there].sum()) > 0.0
        slope = follow[there].sum() / move[there].sum()
        if slope < FLAT * follow[same_way].sum() / move[same_way].sum():
            raise InputError(
                f"record {name}: {axis} saturates: at the {end} of its drive it moves less than"
                f" {FLAT:.0%} as far per volt as elsewhere; record it with less than"
                f" {np.ptp(drive):.3g} V peak to peak"
            )
