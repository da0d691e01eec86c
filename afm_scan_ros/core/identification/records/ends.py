"""A record that flattens towards the ends of its drive: an amplifier or a stage at its limit."""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.types import Array

END, FLAT = 0.05, 0.5
"""A record saturates where its slope in this share at an end is below this share of the mean."""
SLOW = 0.9
"""Correlation of drive and displacement from which a record is slow enough to have slopes."""
SHORT, CLEAR = 0.01, 5.0
"""What a motion falls short by at an end, over its range and over its usual error, to be told."""
NORMAL = 1.4826
"""Standard deviation of normal noise over the median of its size."""


def saturation_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a slow record, (n,) in V and m, flattens towards an end of its drive.

    Hysteresis steepens a loop towards its ends; an amplifier or a stage at its limit flattens it.
    A drive of few steps has no slopes, a ramp but one end.
    """
    move, follow = np.diff(drive), np.diff(displacement)
    slow = np.corrcoef(drive, displacement)[0, 1] > SLOW
    if not slow or np.mean(move != 0.0) < 0.5:  # noqa: PLR2004 - most of the time
        return
    near = END * np.ptp(drive)
    ends = {
        "top": (move > 0.0) & (drive[1:] > drive.max() - near),
        "bottom": (move < 0.0) & (drive[1:] < drive.min() + near),
    }
    for end, there in ends.items():
        if not there.any():
            continue
        same_way = move * np.sign(move[there].sum()) > 0.0
        slope = follow[there].sum() / move[there].sum()
        if slope < FLAT * follow[same_way].sum() / move[same_way].sum():
            yield (
                f"{axis} saturates: at the {end} of its drive it moves less than {FLAT:.0%} as far"
                f" per volt as elsewhere; record it with less than {np.ptp(drive):.3g} V peak to"
                " peak"
            )


def shortfalls(expected: Array, found: Array) -> Sequence[tuple[str, float]]:
    """Ends of a motion, both (n,), at which less of it is found than expected, and how much less.

    That is the mean in the last twentieth of its range, over the range.
    """
    extent, error = float(np.ptp(expected)), found - expected
    told = []
    for end, sign in (("top", 1.0), ("bottom", -1.0)):
        outward = sign * expected
        there = outward > outward.max() - END * extent
        short = -sign * float(np.mean(error[there]))
        if short > max(SHORT * extent, CLEAR * NORMAL * float(np.median(np.abs(error)))):
            told.append((end, short / extent))
    return told
