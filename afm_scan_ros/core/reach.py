"""Checks that the drive of a scan is within limits, and finds the largest possible ranges."""

from collections.abc import Generator

from attrs import evolve

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.learning.correction import Correction, Stop
from afm_scan_ros.core.scan_spec import SMALLEST_RANGE, ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES

BLOCK = 5000
"""Samples inverted at once: some 10 ms of work."""
RESOLUTION = 0.01
"""Of a range that is found."""
SEARCHED = 200_000
"""First samples of a scan by which ranges are searched; the result is checked on all of them."""
SHRINKAGE = 0.98
"""Factor on both ranges where a later sample needs more than those that were searched."""

Ranges = dict[str, float]
"""Range (m) of each axis."""


def preflight(
    compensation: Compensation, spec: ScanSpec, samples: int, learned: Correction | None = None
) -> Generator[str, None, None]:
    """Invert the first ``samples`` of a scan in pieces; yield before each what is being done.

    ``learned`` is what changes its reference, if anything does.

    Raises ScanError naming sample, axis and value where the drive leaves the model's identified
    range or a limit.
    """
    progress = compensation.at_rest()
    stop: Stop = None
    for first in range(0, samples, BLOCK):
        yield f"inverting the scan: sample {first} of {samples}"
        block = desired(spec, first, min(BLOCK, samples - first))
        if learned is not None:
            stop, block = learned.follow(stop, block)
        progress, _ = compensation.invert(progress, block)
    compensation.finish(progress)


def largest_ranges(
    compensation: Compensation, spec: ScanSpec, samples: int
) -> Generator[str, None, Ranges]:
    """Largest ranges (m) up to those of ``spec`` with which the scan's drive can be had.

    x is found first, with y at rest, and then y, so that both hold together; all else of the scan
    stays. Each is bisected to ``RESOLUTION``, as a larger range needs a larger drive: at most 17
    inversions of ``SEARCHED`` samples, and one or a few of all. Empty where no range will do, for
    the preparation needs too much by itself. Yields what is being done, as ``preflight``.
    """
    samples = min(samples, total_samples(spec))
    found = dict.fromkeys(AXES, SMALLEST_RANGE)
    searched = min(samples, SEARCHED)
    if not (yield from _drivable(compensation, _ranged(spec, found), searched)):
        return {}
    for axis, asked in zip(AXES, (spec.range_x, spec.range_y), strict=True):
        low, high = SMALLEST_RANGE, asked
        trial = high
        while high - low > RESOLUTION * high:
            ranged = _ranged(spec, {**found, axis: trial})
            if (yield from _drivable(compensation, ranged, searched)):
                low = trial
            else:
                high = trial
            trial = 0.5 * (low + high)
        found[axis] = low
    while not (yield from _drivable(compensation, _ranged(spec, found), samples)):
        found = {axis: max(SMALLEST_RANGE, SHRINKAGE * each) for axis, each in found.items()}
    return found


def _drivable(
    compensation: Compensation, spec: ScanSpec, samples: int
) -> Generator[str, None, bool]:
    try:
        for _ in preflight(compensation, spec, samples):
            yield "finds the largest range"
    except ScanError:
        return False
    return True


def _ranged(spec: ScanSpec, ranges: Ranges) -> ScanSpec:
    return evolve(spec, range_x=ranges["x"], range_y=ranges["y"])
