"""A record that flattens towards the ends of its drive: an amplifier or a stage at its limit."""

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend
from scipy.stats import t as student

from afm_scan_ros.core.identification.covariance import NORMAL_95
from afm_scan_ros.core.identification.hysteresis.reversal_curves import turning_points
from afm_scan_ros.core.types import Array

Mask: TypeAlias = NDArray[np.bool_]

END, FLAT = 0.05, 0.5
"""A record saturates where its slope in this share at an end is below this share of the mean."""
FAR = 0.5
"""Share of the drive's range that a branch covers whose slopes are compared."""
SLOW = 0.9
"""Correlation of drive and displacement from which a record is slow enough to have slopes."""
SHORT, CLEAR = 0.01, 5.0
"""Shortfall of a motion at an end, over its range and over its usual error, that is reported."""
NORMAL = 1.4826
"""Standard deviation of normal noise over the median of its size."""


def saturation_problems(axis: str, drive: Array, displacement: Array) -> Iterator[str]:
    """Yield where a slow record, (n,) in V and m, flattens towards an end of its drive.

    What is at its limit stands still while the drive comes there and while it goes back, for it
    has no memory. Hysteresis bends the two ways apart: it flattens one at most, and loses heat only
    where the other is the steeper. So the steeper way counts, beside the mean slope of the same
    branches. Branches are compared that cover much of the range, as every branch is flat, or
    steep, where it has just turned. A drive of few steps has no slopes, a ramp but one end.
    """
    slow = np.corrcoef(drive, displacement)[0, 1] > SLOW
    if not slow or np.mean(np.diff(drive) != 0.0) < 0.5:  # noqa: PLR2004 - most of the time
        return
    near = END * np.ptp(drive)
    for end, there in (("top", drive > drive.max() - near), ("bottom", drive < drive.min() + near)):
        slopes = _slopes(drive, displacement, there)
        if slopes and max(slopes) < FLAT:
            yield (
                f"{axis} saturates: at the {end} of its drive it moves less than {FLAT:.0%} as far"
                f" per volt as elsewhere; record it with less than {np.ptp(drive):.3g} V peak to"
                " peak"
            )


def _slopes(drive: Array, displacement: Array, there: Mask) -> list[float]:
    """Slopes where the drive is ``there``, over the mean: of branches that come, and that go."""
    turns = np.concatenate([[0], turning_points(drive), [len(drive) - 1]])
    first, last = turns[:-1], turns[1:]
    long = np.abs(drive[last] - drive[first]) > FAR * np.ptp(drive)
    found = []
    for inward, outward in ((there[last], there[first]), (there[first], there[last])):
        chosen = long & inward & ~outward
        near, whole, noise = [], np.zeros(2), 0.0
        for m, n in zip(first[chosen], last[chosen], strict=True):
            both = np.stack((drive[m : n + 1], displacement[m : n + 1]))
            within = both[:, there[m : n + 1]]
            near.append(within[:, -1] - within[:, 0])
            noise = float(np.std(detrend(within[1])))
            whole += both[:, -1] - both[:, 0]
        if near and np.sum(near, axis=0)[0] != 0.0:
            found.append(float(_most(np.array(near), noise) * whole[0] / whole[1]))
    return found


def _most(ways: Array, noise: float) -> float:
    """Slope of a displacement over its drive, ways of both (branches, 2): the most it may be.

    What branches differ by is noise and hum, the upper 97.5 % limit Student's. For one branch
    they follow from its scatter about its line, a ``noise`` at both ends of its way.
    """
    slope = float(np.sum(ways[:, 1]) / np.sum(ways[:, 0]))
    if len(ways) == 1:
        return slope + NORMAL_95 * float(np.sqrt(2.0) * noise / np.abs(ways[0, 0]))
    residual = ways[:, 1] - slope * ways[:, 0]
    error = float(np.std(residual, ddof=1) * np.sqrt(len(ways)) / np.abs(np.sum(ways[:, 0])))
    return slope + float(student.ppf(0.975, len(ways) - 1)) * error


def shortfalls(expected: Array, found: Array) -> Sequence[tuple[str, float]]:
    """Ends of a motion, both (n,), at which less of it is found than expected, and how much less.

    That is the mean in the last twentieth of its range, over the range.
    """
    extent, error = float(np.ptp(expected)), found - expected
    detected = []
    for end, sign in (("top", 1.0), ("bottom", -1.0)):
        outward = sign * expected
        there = outward > outward.max() - END * extent
        short = -sign * float(np.mean(error[there]))
        if short > max(SHORT * extent, CLEAR * NORMAL * float(np.median(np.abs(error)))):
            detected.append((end, short / extent))
    return detected
