"""The desired displacement of a scan, computed sample by sample from its ScanSpec alone.

The preparation is an oscillation that sets the hysteresis state before the lines. A pattern is
defined for every sample number, before its first line and after its last one too; the approach and
the settling are that continuation under an envelope that rises from 0 to 1 and falls back. So they
join without a jump in position, nor in velocity where the pattern itself has none, and never leave
the scan's range. The scan's centre is added to all of them: it is approached in the first cycle of
the preparation, or where there is none with the pattern, and held to the end. From there the driver
ramps down, for a unipolar scanner with hysteresis has no drive that brings it back to zero.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from math import pi

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.arguments import SPEC, of_type
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace, channels_of


def smooth_step(s: Array) -> Array:
    """Rise from 0 to 1 with least jerk, the quintic of Flash and Hogan (1985), rest to rest."""
    s = s.clip(0.0, 1.0)
    near = np.minimum(s, 1.0 - s)
    return _from_both_ends(s, near * near * near * (10.0 + near * (6.0 * near - 15.0)))


def soft_ramp(s: Array, share: float) -> Array:
    """Rise from 0 (s <= 0) to 1 (s >= 1) at constant speed, but for both ends.

    A ``share`` of the rise is spent accelerating and braking, each by half of a Hann-shaped pulse.
    """
    s = s.clip(0.0, 1.0)
    return _from_both_ends(s, _from_corner(np.minimum(s, 1.0 - s), share))


def _from_both_ends(s: Array, near: Array) -> Array:
    """Mirror what is known near an end, so that rounding never goes beyond 1."""
    return np.where(s <= 0.5, near, 1.0 - near)  # noqa: PLR2004 - a half


def _from_corner(s: Array, share: float) -> Array:
    """Way done at ``s`` in [0, 1/2] after a corner, where the acceleration pulse has its peak."""
    speed = 1.0 / (1.0 - share * (0.5 - 2.0 / pi**2))
    steady = speed * (s - share * (0.25 - 1.0 / pi**2))
    if share == 0.0:
        return steady
    phase = 2.0 * pi * np.minimum(s / share, 0.5)
    turning = speed * share / (2.0 * pi**2) * (0.5 * phase * phase + 1.0 - np.cos(phase))
    return np.where(s < 0.5 * share, turning, steady)


KEPT = 2
"""Scans of which a line is kept: it may have ten million samples."""


def raster(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement (m) at sample numbers from the first line's start; x rests before and after."""
    number, way = line_and_way(spec, samples)
    return _line_x(spec)[way], stepped_y(spec, number, way)


def line_and_way(
    spec: ScanSpec, samples: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return each sample's line and its number on that; the scan's ends where it is outside."""
    inside = samples.clip(0, spec.lines * spec.samples_per_line)
    number = inside // spec.samples_per_line
    return number, inside - number * spec.samples_per_line


def stepped_y(spec: ScanSpec, number: NDArray[np.int64], way: NDArray[np.int64]) -> Array:
    """Displacement in y, m: ``lines`` levels from ``-range_y / 2`` to ``range_y / 2``."""
    level = (number + _line_rise(spec)[way]).clip(0.0, spec.lines - 1.0)
    return spec.range_y * (level / (spec.lines - 1) - 0.5)


def step_age(spec: ScanSpec, way: NDArray[np.int64]) -> Array:
    """Return how many samples ago y began to step: where the trace's constant-speed part ends."""
    period = float(spec.samples_per_line)
    age: Array = np.mod(way - 0.5 * period * (1.0 - 0.5 * spec.turnaround), period)
    return age


@lru_cache(KEPT)
def _line_x(spec: ScanSpec) -> Array:
    """x, m, on a line."""
    way = np.arange(spec.samples_per_line)
    s = np.minimum(way, spec.samples_per_line - way) / (spec.samples_per_line // 2)
    return spec.range_x * (soft_ramp(s, spec.turnaround) - 0.5)


@lru_cache(KEPT)
def _line_rise(spec: ScanSpec) -> Array:
    """Steps of y on a line, less the line's number: below zero until its own begins."""
    way = np.arange(spec.samples_per_line)
    age = step_age(spec, way)
    return smooth_step(age * (spec.sample_period / spec.y_step)) - (age > way)


def sinusoidal(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement (m) at sample numbers from the first line's start, at rest at -range_x / 2."""
    turn = (samples % spec.samples_per_line) / spec.samples_per_line
    y = stepped_y(spec, *line_and_way(spec, samples))
    return -0.5 * spec.range_x * np.cos(2.0 * np.pi * turn), y


def spiral(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the first turn's start.

    The radius grows over all turns but the last, which is the whole outer ellipse. The scanner
    rests at the centre before, and stays on the ellipse after.
    """
    growing = spec.lines - 1
    turn = (samples % spec.samples_per_line) / spec.samples_per_line
    turns = samples / spec.samples_per_line
    radius = 0.5 * soft_ramp(turns / growing, min(1.0, 2.0 / growing))
    angle = 2.0 * np.pi * turn
    return spec.range_x * radius * np.cos(angle), spec.range_y * radius * np.sin(angle)


def lissajous(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement (m) at sample numbers from the centre on: in y one period fewer than in x."""
    return (
        0.5 * spec.range_x * _sine(spec, samples, spec.lines),
        0.5 * spec.range_y * _sine(spec, samples, spec.lines - 1),
    )


def _sine(spec: ScanSpec, samples: NDArray[np.int64], periods: int) -> Array:
    whole = spec.lines * spec.samples_per_line
    turn = (samples * periods % whole) / whole
    result: Array = np.sin(2.0 * np.pi * turn)
    return result


@frozen
class Phases:
    """The sample numbers of each phase of a scan; each phase begins where the one before ends."""

    preparation: range
    approach: range
    lines: range
    settle: range

    @property
    def total(self) -> int:
        """Samples in the scan."""
        return self.settle.stop


def phases(spec: ScanSpec) -> Phases:
    """Return where each phase of a scan lies; the very last sample is at rest at the centre."""
    prepared = 0
    if spec.preparation != "none":
        prepared = round(spec.preparation_cycles / (spec.preparation_rate * spec.sample_period))
    approached = prepared + max(1, round(spec.approach / spec.sample_period))
    scanned = approached + spec.lines * spec.samples_per_line
    return Phases(
        preparation=range(prepared),
        approach=range(prepared, approached),
        lines=range(approached, scanned),
        settle=range(scanned, scanned + settle_samples(spec) + 1),
    )


def total_samples(spec: ScanSpec) -> int:
    """Samples in the whole scan, preparation, approach and settling included."""
    return phases(spec).total


def settle_samples(spec: ScanSpec) -> int:
    """Samples from the last line's end to rest."""
    return max(1, round(spec.settle / spec.sample_period))


def preparation(spec: ScanSpec, samples: NDArray[np.int64]) -> Array:
    """Displacement in m from the centre, the same along both axes, from the scan's start on."""
    cycles = _prepared_cycles(spec, samples)
    if spec.preparation == "saturate":
        # from zero to the upper bound and back, once a cycle
        return np.asarray(spec.preparation_upper * 0.5 * (1.0 - np.cos(2.0 * np.pi * cycles)))
    return _decaying_oscillation(spec, cycles)


def _prepared_cycles(spec: ScanSpec, samples: NDArray[np.int64]) -> Array:
    """Cycles of the preparation that are over at sample numbers from the scan's start."""
    return np.asarray(spec.preparation_cycles * (samples / len(phases(spec).preparation)))


def _decaying_oscillation(spec: ScanSpec, cycles: Array) -> Array:
    """Swing between the bounds: a cycle to rise, a whole one, and the rest to decay evenly."""
    rise = min(1.0, 0.25 * spec.preparation_cycles)
    decay = spec.preparation_cycles - 2.0 * rise
    envelope = smooth_step(cycles / rise) * (1.0 - soft_ramp((cycles - 2.0 * rise) / decay, 0.2))
    centre = 0.5 * (spec.preparation_upper + spec.preparation_lower)
    amplitude = 0.5 * (spec.preparation_upper - spec.preparation_lower)
    result: Array = envelope * (centre + amplitude * np.sin(2.0 * np.pi * (cycles % 1.0)))
    return result


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


Pattern = Callable[[ScanSpec, NDArray[np.int64]], tuple[Array, Array]]

PATTERN: Mapping[str, Pattern] = {
    "raster": raster,
    "sinusoidal": sinusoidal,
    "spiral": spiral,
    "lissajous": lissajous,
}


def desired(spec: ScanSpec, first: int, count: int) -> Trace:
    """Desired displacement (m) of ``count`` samples, by their numbers alone; at rest at its end."""
    x, y = _displacement(spec, np.arange(first, first + count, dtype=np.int64))
    return Trace(first, spec.sample_period, x, y)


def stopped(spec: ScanSpec, stop: int, first: int, count: int) -> Trace:
    """Desired displacement (m) of a scan stopped at a sample: it settles towards the centre."""
    samples = np.arange(first, first + count, dtype=np.int64)
    x, y = _displacement(spec, samples)
    held_x, held_y = _centre(spec, samples)
    envelope = 1.0 - smooth_step((samples - stop) / settle_samples(spec))
    x, y = held_x + envelope * (x - held_x), held_y + envelope * (y - held_y)
    return Trace(first, spec.sample_period, x, y)


def stopped_total(spec: ScanSpec, stop: int) -> int:
    """Samples in a scan that is stopped at sample ``stop``; the last one is at rest."""
    return min(phases(spec).total, stop + settle_samples(spec) + 1)


def _displacement(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at consecutive sample numbers: preparation, pattern, then zero."""
    where = phases(spec)
    x, y = np.zeros(samples.size), np.zeros(samples.size)
    early, over = np.searchsorted(samples, (where.preparation.stop, where.total))
    if early:
        x[:early] = y[:early] = preparation(spec, samples[:early])
    if over > early:
        numbers = samples[early:over] - where.lines.start
        pattern_x, pattern_y = PATTERN[spec.pattern](spec, numbers)
        envelope = _envelope(spec, numbers)
        x[early:over], y[early:over] = envelope * pattern_x, envelope * pattern_y
    if spec.centre_x != 0.0 or spec.centre_y != 0.0:
        held_x, held_y = _centre(spec, samples)
        x += held_x
        y += held_y
    return x, y


def _envelope(spec: ScanSpec, samples: NDArray[np.int64]) -> Array | float:
    """Rise over the approach and fall over the settling; exactly 1 on the lines."""
    end = spec.lines * spec.samples_per_line
    if samples[0] >= 0 and samples[-1] <= end:
        return 1.0
    rise = smooth_step(1.0 + samples / len(phases(spec).approach))
    return rise * (1.0 - smooth_step((samples - end) / settle_samples(spec)))


def _centre(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """What is held of the centre, m, at sample numbers from the scan's start."""
    where = phases(spec)
    if spec.preparation == "none":
        rise = (samples - where.approach.start) / len(where.approach)
    else:
        rise = _prepared_cycles(spec, samples)
    held = smooth_step(rise)
    return spec.centre_x * held, spec.centre_y * held


def trajectory(spec: ScanSpec) -> Array:
    """Return the desired displacement of a whole scan.

    Parameters
    ----------
    spec
        The scan.

    Returns
    -------
    ndarray
        m, shape (n, 2): x and y, every ``spec.sample_period``. It begins at rest at zero, before
        the preparation and the approach of ``spec``, and ends at its centre, after the settling.

    Raises
    ------
    InputError
        Where ``spec`` is no scan.

    Examples
    --------
    >>> import afm_scan_ros as afm
    >>> spec = afm.ScanSpec(range_x=10e-6, range_y=10e-6, lines=2, preparation="none")
    >>> desired = afm.trajectory(spec)
    >>> desired.shape, float(desired[:, 0].max())
    ((12001, 2), 5e-06)
    """
    of_type(ScanSpec, "spec", spec, SPEC)
    return channels_of(desired(spec, 0, total_samples(spec)), AXES)
