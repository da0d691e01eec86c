"""The kind of each sample of a line: trace, retrace, turn-around or step."""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.patterns import step_age
from afm_scan_ros.core.trajectory.phases import phases

TO_AND_FRO = ("raster", "sinusoidal")


@frozen(eq=False)
class SampleKinds:
    """What each sample of a run is; all arrays have shape (n,).

    ``line`` is the number of the to-and-fro, -1 outside the lines. ``trace`` and ``retrace`` mark
    their parts between the turn-arounds, where a raster's speed is constant, ``turnaround`` the
    rest of the lines. Patterns that are not to-and-fro are ``trace`` throughout. ``y_step`` marks
    the smooth steps of y.
    """

    line: NDArray[np.int64]
    trace: NDArray[np.bool_]
    retrace: NDArray[np.bool_]
    turnaround: NDArray[np.bool_]
    y_step: NDArray[np.bool_]


def sample_kinds(spec: ScanSpec, first: int, count: int) -> SampleKinds:
    """Return the kinds of samples ``first`` to ``first + count - 1`` of a scan."""
    where = phases(spec)
    samples = np.arange(first, first + count, dtype=np.int64)
    on_line = (samples >= where.lines.start) & (samples < where.lines.stop)
    numbers = samples - where.lines.start
    line = np.where(on_line, numbers // spec.samples_per_line, -1)
    if spec.pattern not in TO_AND_FRO:
        nothing = np.zeros(count, dtype=np.bool_)
        return SampleKinds(line, on_line, nothing, nothing, nothing)
    half = spec.samples_per_line // 2
    corner = np.minimum(numbers % half, half - numbers % half)
    steady = on_line & (corner >= 0.5 * spec.turnaround * half)
    way = numbers % spec.samples_per_line
    forward = way < half
    step = on_line & _steps(spec, line, way)
    return SampleKinds(line, steady & forward, steady & ~forward, on_line & ~steady, step)


def _steps(spec: ScanSpec, line: NDArray[np.int64], way: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mark the samples of the y steps; a line's own step leads to the next line."""
    age = step_age(spec, way)
    latest = line - (age > way)
    stepping: NDArray[np.bool_] = age * spec.sample_period < spec.y_step
    return stepping & (latest >= 0) & (latest < spec.lines - 1)
