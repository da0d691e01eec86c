"""What of a residual repeats from line to line of a scan, and what differs to and fro."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO
from afm_scan_ros.core.types import Array

FEWEST = 2
"""Lines after the first, fewer than which nothing can be seen to repeat."""


@frozen(eq=False)
class Locked:
    """Shares of the residual's mean square on the lines, the first left out; they add up to 1.

    ``to_scan`` repeats from line to line, ``to_time`` is what all of a line has in common and
    another has not, ``rest`` is neither.
    """

    to_scan: float
    to_time: float
    rest: float


@frozen(eq=False)
class ToAndFro:
    """The mean line's residual (n,) on ``trace`` and, at the same places, on ``retrace``, in m.

    ``place`` (n,) runs from 0 to 1 along the trace.
    """

    place: Array
    trace: Array
    retrace: Array

    @property
    def alike(self) -> float:
        """Rms of what trace and retrace share: a matter of place, m."""
        return float(np.sqrt(np.mean((0.5 * (self.trace + self.retrace)) ** 2)))

    @property
    def unlike(self) -> float:
        """Rms of half of what they differ by: a matter of direction, m."""
        return float(np.sqrt(np.mean((0.5 * (self.trace - self.retrace)) ** 2)))


def locked(residual: Array, spec: ScanSpec) -> Locked | None:
    """Split the residual (m) of a whole scan; None where there are too few lines."""
    lines = _lines(residual, spec)
    if lines is None:
        return None
    count = len(lines)
    by_time, by_scan = lines.mean(axis=1, keepdims=True), lines.mean(axis=0)
    rest = float(np.mean((lines - by_time - by_scan) ** 2)) * count / (count - 1)
    seen = max(0.0, float(np.mean(by_scan**2)) - rest / count)
    parts = np.array([seen, float(np.mean(by_time**2)), rest])
    return Locked(*(parts / max(float(parts.sum()), np.finfo(float).tiny)).tolist())


def to_and_fro(residual: Array, spec: ScanSpec) -> ToAndFro | None:
    """Mean trace and retrace; None for patterns that have none, or where lines are too few."""
    lines = _lines(residual, spec)
    if lines is None or spec.pattern not in TO_AND_FRO:
        return None
    mean, half = lines.mean(axis=0), spec.samples_per_line // 2
    return ToAndFro(np.arange(half) / half, mean[:half], np.roll(mean[::-1], 1)[:half])


def _lines(residual: Array, spec: ScanSpec) -> Array | None:
    """Lines after the first, (lines, samples), about their common mean."""
    period = spec.samples_per_line
    where = phases(spec).lines
    count = (min(len(residual), where.stop) - where.start) // period - 1
    if count < FEWEST:
        return None
    first = where.start + period
    lines = residual[first : first + count * period].reshape(count, period)
    return np.asarray(lines - lines.mean())
