"""Laws of the desired trajectory, whatever the pattern."""

from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import PATTERNS, PREPARATIONS, ScanSpec
from afm_scan_ros.core.trajectory import (
    desired,
    phases,
    sample_kinds,
    stopped,
    stopped_total,
    total_samples,
)
from afm_scan_ros.core.types import AXES, Array, Trace


@st.composite
def specs(draw: st.DrawFn, patterns: tuple[str, ...] = PATTERNS) -> ScanSpec:
    line_rate = draw(st.floats(1.0, 250.0))
    samples_per_line = 4 * draw(st.integers(10, 200))
    turnaround = draw(st.sampled_from([0.0, 0.1, 0.3, 0.9]))
    period = 1.0 / line_rate
    return ScanSpec(
        pattern=draw(st.sampled_from(patterns)),
        range_x=draw(st.floats(1e-9, 1e-4)),
        range_y=draw(st.floats(1e-9, 1e-4)),
        line_rate=line_rate,
        lines=draw(st.integers(2, 7)),
        samples_per_line=samples_per_line,
        turnaround=turnaround,
        y_step=period * draw(st.floats(0.03, 0.499 * (1.0 + turnaround))),
        preparation=draw(st.sampled_from(PREPARATIONS)),
        preparation_rate=line_rate,
        preparation_cycles=draw(st.integers(1, 6)),
        approach=period * draw(st.floats(0.5, 2.0)),
        settle=period * draw(st.floats(0.5, 2.0)),
    )


def whole(spec: ScanSpec) -> Trace:
    return desired(spec, 0, total_samples(spec))


def on_lines(spec: ScanSpec, values: Array) -> Array:
    """Samples of the lines and the one that closes the last line."""
    where = phases(spec).lines
    return values[where.start : where.stop + 1]


@given(specs(), st.data())
@settings(deadline=None)
def test_any_cut_into_blocks_gives_the_same_samples(spec: ScanSpec, data: st.DataObject) -> None:
    total = total_samples(spec)
    cuts = sorted(data.draw(st.lists(st.integers(0, total), max_size=6)))
    edges = [0, *cuts, total]
    blocks = [desired(spec, a, b - a) for a, b in pairwise(edges)]
    for axis in AXES:
        joined = np.concatenate([block.axis(axis) for block in blocks])
        assert np.array_equal(joined, whole(spec).axis(axis))


@given(specs(), st.data())
@settings(deadline=None)
def test_any_cut_gives_the_same_kinds(spec: ScanSpec, data: st.DataObject) -> None:
    total = total_samples(spec)
    at = data.draw(st.integers(0, total))
    first, second = sample_kinds(spec, 0, at), sample_kinds(spec, at, total - at)
    everything = sample_kinds(spec, 0, total)
    for name in ("line", "trace", "retrace", "turnaround", "y_step"):
        joined = np.concatenate([getattr(first, name), getattr(second, name)])
        assert np.array_equal(joined, getattr(everything, name))


@given(specs())
@settings(deadline=None)
def test_it_starts_and_ends_at_rest_at_zero(spec: ScanSpec) -> None:
    trace = whole(spec)
    for axis in AXES:
        values = trace.axis(axis)
        assert values[0] == 0.0
        assert values[-1] == 0.0
        after = desired(spec, total_samples(spec), 10).axis(axis)
        assert np.array_equal(after, np.zeros(10))


@given(specs())
@settings(deadline=None)
def test_the_ranges_are_peak_to_peak(spec: ScanSpec) -> None:
    trace = whole(spec)
    for axis, full in (("x", spec.range_x), ("y", spec.range_y)):
        peak = np.ptp(on_lines(spec, trace.axis(axis)))
        if axis == "y" and spec.pattern == "lissajous":  # its peaks lie between samples
            assert full * np.cos(np.pi / spec.samples_per_line) <= peak <= full * (1 + 1e-15)
        else:
            assert peak == pytest.approx(full, rel=1e-15)


@given(specs())
@settings(deadline=None)
def test_it_never_leaves_the_range_nor_the_preparation(spec: ScanSpec) -> None:
    trace, where = whole(spec), phases(spec)
    prepared = where.preparation.stop
    for axis, full in (("x", spec.range_x), ("y", spec.range_y)):
        values = trace.axis(axis)
        assert np.abs(values[prepared:]).max() <= 0.5 * full * (1 + 1e-15)
        assert np.all(values[:prepared] >= spec.preparation_lower)
        assert np.all(values[:prepared] <= spec.preparation_upper)


@given(specs(), st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4), st.data())
@settings(deadline=None)
def test_a_centre_moves_the_whole_scan(
    spec: ScanSpec, x: float, y: float, data: st.DataObject
) -> None:
    """It is approached before the lines, never passed, and held to the end, also of a stop."""
    about, trace, where = whole(spec), whole(evolve(spec, centre_x=x, centre_y=y)), phases(spec)
    cut = data.draw(st.integers(0, where.total))
    later = desired(evolve(spec, centre_x=x, centre_y=y), cut, where.total - cut)
    ended = stopped(evolve(spec, centre_x=x, centre_y=y), cut, cut, len(where.settle) + 1)
    for axis, centre in (("x", x), ("y", y)):
        assert np.array_equal(trace.axis(axis)[cut:], later.axis(axis))
        held = trace.axis(axis) - about.axis(axis)
        assert held[0] == 0.0
        assert held[where.lines.start :] == pytest.approx(centre, rel=1e-9, abs=1e-18)
        assert np.all(np.diff(held * np.sign(centre)) >= -1e-18)
        assert trace.axis(axis)[-1] == centre
        end = min(cut + len(where.settle), where.total - 1)
        assert ended.axis(axis)[-1] == pytest.approx(held[end], abs=1e-18)


def fastest_x(spec: ScanSpec) -> float:
    """Greatest speed of x on lines, approach and settling, m/s, with the envelope's 15/8."""
    half_period = 0.5 / spec.line_rate
    hann = 1.0 - spec.turnaround * (0.5 - 2.0 / np.pi**2)
    pattern = {"raster": 1.0 / hann, "spiral": 0.5 * np.pi + 1.0}.get(spec.pattern, 0.5 * np.pi)
    envelope = 0.5 * 15 / 8 * half_period / min(spec.approach, spec.settle)
    return spec.range_x * (pattern + 1.1 * envelope) / half_period


@given(specs())
@settings(deadline=None)
def test_no_jump_is_bigger_than_the_speed_allows(spec: ScanSpec) -> None:
    x = whole(spec).x[phases(spec).approach.start :]
    assert np.abs(np.diff(x)).max() <= fastest_x(spec) * spec.sample_period * (1 + 1e-9)


@given(specs(("raster",)))
@settings(deadline=None)
def test_a_raster_is_at_constant_speed_between_its_turn_arounds(spec: ScanSpec) -> None:
    trace = whole(spec)
    kinds = sample_kinds(spec, 0, trace.x.size)
    steps = np.diff(trace.x)
    share = 1.0 - spec.turnaround * (0.5 - 2.0 / np.pi**2)
    step = 2.0 * spec.range_x / (share * spec.samples_per_line)
    for mask, sign in ((kinds.trace, 1.0), (kinds.retrace, -1.0)):
        inside = mask[:-1] & mask[1:]
        assert np.allclose(steps[inside], sign * step, rtol=0.0, atol=1e-14 * spec.range_x)


@given(specs(("raster",)))
@settings(deadline=None)
def test_a_smooth_raster_has_no_jump_in_velocity(spec: ScanSpec) -> None:
    if spec.turnaround == 0.0:
        return
    x = whole(spec).x[phases(spec).approach.start :]
    acceleration = np.abs(np.diff(x, 2)) / spec.sample_period**2
    half_period = 0.5 / spec.line_rate
    speed = spec.range_x / (half_period * (1.0 - spec.turnaround * (0.5 - 2.0 / np.pi**2)))
    hann = 4.0 * speed / (spec.turnaround * half_period)
    # The least-jerk step's acceleration peaks at 10 / sqrt(3) times distance / duration squared.
    envelope = 0.5 * spec.range_x * 10 / np.sqrt(3) / min(spec.approach, spec.settle) ** 2
    assert acceleration.max() <= (hann + 1.1 * envelope) * (1 + 1e-6)


@given(specs(("raster", "sinusoidal")))
@settings(deadline=None)
def test_y_steps_evenly_and_only_in_its_window(spec: ScanSpec) -> None:
    trace = whole(spec)
    kinds = sample_kinds(spec, 0, trace.x.size)
    lines = on_lines(spec, trace.y)
    assert np.all(np.diff(lines) >= -1e-15 * spec.range_y)
    levels = [np.unique(trace.y[kinds.trace & (kinds.line == k)]) for k in range(spec.lines)]
    assert [level.size for level in levels] == [1] * spec.lines
    expected = np.linspace(-0.5, 0.5, spec.lines) * spec.range_y
    assert np.allclose(np.concatenate(levels), expected, rtol=0.0, atol=1e-15 * spec.range_y)
    moving = np.flatnonzero(np.diff(trace.y)) + 1
    inside = phases(spec).lines
    moving = moving[(moving > inside.start) & (moving < inside.stop)]
    assert np.all(kinds.y_step[moving] | kinds.y_step[moving - 1])


@given(specs())
@settings(deadline=None)
def test_every_sample_of_a_line_is_of_one_kind(spec: ScanSpec) -> None:
    kinds = sample_kinds(spec, 0, total_samples(spec))
    count = kinds.trace.astype(int) + kinds.retrace + kinds.turnaround
    assert np.array_equal(count == 1, kinds.line >= 0)
    assert np.array_equal(count == 0, kinds.line < 0)
    where = phases(spec).lines
    numbers = np.repeat(np.arange(spec.lines), spec.samples_per_line)
    assert np.array_equal(kinds.line[where.start : where.stop], numbers)


@given(specs(("raster",)))
@settings(deadline=None)
def test_the_retrace_mirrors_the_trace(spec: ScanSpec) -> None:
    x = on_lines(spec, whole(spec).x)
    assert np.array_equal(x, x[::-1])


@given(specs(("lissajous",)))
@settings(deadline=None)
def test_a_lissajous_figure_closes(spec: ScanSpec) -> None:
    for axis in AXES:
        lines = on_lines(spec, whole(spec).axis(axis))
        assert lines[0] == lines[-1]


@given(specs(("spiral",)))
@settings(deadline=None)
def test_a_spiral_turns_at_a_constant_rate_and_widens(spec: ScanSpec) -> None:
    trace = whole(spec)
    x, y = on_lines(spec, trace.x) / spec.range_x, on_lines(spec, trace.y) / spec.range_y
    radius = np.hypot(x, y)
    assert np.all(np.diff(radius) >= -1e-15)
    turning = radius > 1e-3
    angle = np.unwrap(np.arctan2(y, x)[turning])
    assert np.allclose(np.diff(angle), 2.0 * np.pi / spec.samples_per_line, rtol=1e-6)
    assert radius[-spec.samples_per_line :] == pytest.approx(0.5, rel=1e-14)


@given(specs(), st.data())
@settings(deadline=None)
def test_a_stopped_scan_goes_smoothly_to_rest_at_zero(spec: ScanSpec, data: st.DataObject) -> None:
    stop = data.draw(st.integers(0, total_samples(spec) - 1))
    total = stopped_total(spec, stop)
    planned, actual = desired(spec, 0, total + 5), stopped(spec, stop, 0, total + 5)
    for axis in AXES:
        path, plan = actual.axis(axis), planned.axis(axis)
        assert np.array_equal(path[: stop + 1], plan[: stop + 1])
        assert np.all(np.abs(path) <= np.abs(plan))
        assert np.array_equal(path[total - 1 :], np.zeros(6))
        # The envelope falls no faster than the least-jerk step does.
        fall = 15 / 8 * spec.sample_period / spec.settle * 1.1
        allowed = np.abs(np.diff(plan)) + fall * np.abs(plan[:-1])
        assert np.all(np.abs(np.diff(path)) <= allowed + 1e-18)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_scan_of_weeks_costs_no_memory(pattern: str) -> None:
    """The last block of 4e10 samples, which no memory holds, is had at once and is as exact."""
    spec = ScanSpec(pattern=pattern, lines=10**7)
    total = total_samples(spec)
    end = desired(spec, total - 4000, 4000)
    for axis, full in (("x", spec.range_x), ("y", spec.range_y)):
        assert end.axis(axis)[-1] == 0.0
        assert np.abs(np.diff(end.axis(axis))).max() <= 4.0 * full / spec.samples_per_line


def test_a_depolarisation_reaches_its_bounds_and_decays() -> None:
    spec = ScanSpec(preparation="depolarise", preparation_rate=10.0)
    x = whole(spec).x[: phases(spec).preparation.stop]
    assert x.max() == pytest.approx(spec.preparation_upper, rel=1e-6)
    assert x.min() == pytest.approx(spec.preparation_lower, rel=1e-6)
    cycle = round(1.0 / (spec.preparation_rate * spec.sample_period))
    peaks = x.reshape(-1, cycle).max(axis=1)
    assert np.all(np.diff(peaks[2:]) < 0.0)


@given(st.floats(1e-7, 1e-4), st.floats(1e-7, 1e-4), st.floats(0.01, 1.0))
def test_a_preparation_follows_the_range_unless_it_is_stated(
    x: float, y: float, part: float
) -> None:
    spec = ScanSpec(range_x=x, range_y=y)
    ends = np.array([-spec.preparation_lower, spec.preparation_upper])
    assert ends == pytest.approx(0.6 * max(x, y), rel=1e-15)
    assert spec.resized(part * x, part * y) == ScanSpec(range_x=part * x, range_y=part * y)
    stated = evolve(spec, preparation_lower=-(x + y)).resized(part * x, part * y)
    assert stated.preparation_lower == -(x + y)
    assert stated.preparation_upper == 0.6 * max(part * x, part * y)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"y_step": 0.2}, "y_step = 0.2 s is longer.*at most 0.11 s"),
        ({"y_step": 1e-5}, "y_step = 1e-05 s is shorter"),
        ({"samples_per_line": 4001}, "give 4002"),
        ({"preparation_lower": 1e-6}, "either side of zero"),
        ({"preparation_rate": 1e4}, "at most 2500 Hz"),
    ],
)
def test_parameters_that_contradict_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        evolve(ScanSpec(), **change)
