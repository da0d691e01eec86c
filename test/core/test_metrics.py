"""The figures of a scan: what they are on errors that are known."""

import json

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.metrics import Tracking, TrackingMeter, plain
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, sample_kinds, total_samples
from afm_scan_ros.core.types import Array, Trace

SPEC = ScanSpec(lines=6, samples_per_line=400, line_rate=50.0, preparation_cycles=2, turnaround=0.2)
TOTAL = total_samples(SPEC)
LINES = phases(SPEC).lines


def plus(trace: Trace, x: Array | float, y: Array | float) -> Trace:
    return Trace(trace.first_sample, trace.sample_period, trace.x + x, trace.y + y)


def measured(x: Array | float, y: Array | float, spec: ScanSpec = SPEC) -> Tracking:
    meter = TrackingMeter(spec)
    path = desired(spec, 0, total_samples(spec))
    meter.add(path, plus(path, x, y))
    return meter.tracking()


def noise(seed: int, size: int = TOTAL) -> tuple[Array, Array]:
    x, y = np.random.default_rng(seed).normal(size=(2, size)) * 1e-9
    return x, y


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, TOTAL), max_size=8))
@settings(deadline=None, max_examples=50)
def test_the_figures_do_not_depend_on_the_blocks(seed: int, cuts: list[int]) -> None:
    path = desired(SPEC, 0, TOTAL)
    x, y = noise(seed)
    achieved = plus(path, x, y)
    meter = TrackingMeter(SPEC)
    for a, b in zip([0, *sorted(cuts)], [*sorted(cuts), TOTAL], strict=True):
        meter.add(
            desired(SPEC, a, b - a), Trace(a, path.sample_period, achieved.x[a:b], achieved.y[a:b])
        )
    once, blocks = plain(measured(x, y)), plain(meter.tracking())
    assert flat(blocks) == pytest.approx(flat(once), rel=1e-10)


def flat(values: object) -> list[float]:
    """All numbers of a record, in order."""
    if isinstance(values, dict):
        return [number for value in values.values() for number in flat(value)]
    return [float(values)] if isinstance(values, (int, float)) else []


def test_no_error_gives_no_error() -> None:
    tracking = measured(0.0, 0.0)
    assert tracking.mismatch is not None
    assert tracking.mismatch.largest <= 1e-15 * SPEC.range_x
    for axis in (tracking.x, tracking.y):
        assert axis.all is not None
        assert axis.all.largest == 0.0
        assert axis.repeatability == 0.0
    assert tracking.lines == SPEC.lines
    assert tracking.samples == TOTAL


@given(st.floats(-1e-6, 1e-6), st.floats(-1e-6, 1e-6))
@settings(deadline=None)
def test_the_rms_is_about_zero(x: float, y: float) -> None:
    """An offset is an error in full, and is not one between trace and retrace."""
    tracking = measured(x, y)
    for axis, offset, full in (
        (tracking.x, x, SPEC.range_x),
        (tracking.y, y, SPEC.range_y),
    ):
        for figure in (axis.all, axis.constant_speed, axis.turnarounds, axis.step, axis.trace):
            assert figure is not None
            assert figure.rms == pytest.approx(abs(offset), abs=1e-19)
            assert figure.rms_share == pytest.approx(abs(offset) / full, abs=1e-14)
        assert axis.peak_to_peak == pytest.approx(full)
    assert tracking.mismatch is not None
    assert tracking.mismatch.rms < 1e-18


@pytest.mark.parametrize(
    ("chosen", "figure"),
    [
        ("turnaround", "turnarounds"),
        ("y_step", "step"),
        ("trace", "trace"),
    ],
)
def test_each_figure_sees_its_own_samples_only(chosen: str, figure: str) -> None:
    kinds = sample_kinds(SPEC, 0, TOTAL)
    mask = getattr(kinds, chosen) & (kinds.line >= 1)
    tracking = measured(1e-9 * mask, 1e-9 * ~mask)
    inside, outside = getattr(tracking.x, figure), getattr(tracking.y, figure)
    assert inside.rms == pytest.approx(1e-9)
    assert inside.samples == mask.sum()
    assert outside.rms == 0.0


def test_the_first_line_and_what_comes_before_stand_alone() -> None:
    early = np.where(np.arange(TOTAL) < LINES.start + SPEC.samples_per_line, 1e-9, 0.0)
    tracking = measured(early, early)
    for axis in (tracking.x, tracking.y):
        for figure in (axis.first_line, axis.approach, axis.preparation):
            assert figure is not None
            assert figure.rms == pytest.approx(1e-9)
        assert axis.all is not None
        assert axis.all.largest == 0.0


@given(st.floats(1e-7, 1e-3))
@settings(deadline=None)
def test_a_delay_is_a_mismatch_of_twice_the_way_it_takes(lag: float) -> None:
    """At constant speed a lag moves the trace back and the retrace forth by speed times lag."""
    kinds = sample_kinds(SPEC, 0, TOTAL)
    path = desired(SPEC, 0, TOTAL)
    speed = np.gradient(path.x, path.sample_period)[kinds.trace].max()
    tracking = measured(-speed * lag * (kinds.trace.astype(float) - kinds.retrace), 0.0)
    assert tracking.mismatch is not None
    assert tracking.mismatch.rms == pytest.approx(2.0 * speed * lag, rel=1e-9)


def test_repeatability_is_the_noise_and_not_what_repeats() -> None:
    x, y = noise(3)
    repeating = 1e-6 * np.sin(2.0 * np.pi * np.arange(TOTAL) / SPEC.samples_per_line)
    tracking = measured(x + repeating, y + repeating)
    assert tracking.x.repeatability == pytest.approx(1e-9, rel=0.05)
    assert tracking.y.repeatability == pytest.approx(1e-9, rel=0.05)


def test_a_scan_cut_short_has_the_figures_of_what_is_there() -> None:
    """Shares are of the planned range, also in y, of which less than a half is reached."""
    stop = LINES.start + 3 * SPEC.samples_per_line + 10
    meter = TrackingMeter(SPEC)
    path = desired(SPEC, 0, stop)
    meter.add(path, plus(path, 1e-9, 1e-9))
    tracking = meter.tracking()
    assert (tracking.lines, tracking.samples) == (3, stop)
    assert tracking.x.all is not None
    assert tracking.x.all.rms == pytest.approx(1e-9)
    assert tracking.y.all is not None
    assert tracking.y.all.rms_share == pytest.approx(1e-9 / SPEC.range_y)
    assert tracking.y.planned_range == SPEC.range_y
    assert tracking.y.peak_to_peak == pytest.approx(3 / 5 * SPEC.range_y)


def test_a_scan_cut_before_its_lines_has_no_figures_of_them() -> None:
    meter = TrackingMeter(SPEC)
    path = desired(SPEC, 0, 10)
    meter.add(path, path)
    tracking = meter.tracking()
    assert tracking.x.all is None
    assert tracking.mismatch is None
    assert tracking.x.repeatability is None
    assert tracking.x.preparation is not None
    assert tracking.x.peak_to_peak == 0.0


@pytest.mark.parametrize("pattern", ["spiral", "lissajous"])
def test_a_pattern_without_retrace_has_no_mismatch(pattern: str) -> None:
    spec = ScanSpec(pattern=pattern, lines=3, samples_per_line=400, preparation="none")
    tracking = measured(1e-9, 1e-9, spec)
    assert tracking.mismatch is None
    assert tracking.x.turnarounds is None
    assert tracking.x.constant_speed is not None


def test_the_figures_serialise_with_their_units() -> None:
    text = json.loads(json.dumps(plain(measured(1e-9, 0.0))))
    assert text["x"]["all"]["rms_m"] == pytest.approx(1e-9)
    assert text["x"]["all"]["rms_share"] == pytest.approx(1e-9 / SPEC.range_x)
    assert set(text) == {"displacement", "samples", "lines", "x", "y", "mismatch"}


@given(offset=st.floats(-1e-6, 1e-6), gain=st.floats(-0.02, 0.02), seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_the_error_is_split_into_offset_gain_and_shape(
    offset: float, gain: float, seed: int
) -> None:
    """The offset is that at the scan's centre, and shape what a straight line leaves."""
    spec = evolve(SPEC, centre_x=7e-6, centre_y=-3e-6)
    path, (x, y) = desired(spec, 0, TOTAL), noise(seed)
    found = measured(offset + gain * (path.x - 7e-6) + x, offset + gain * (path.y + 3e-6) + y, spec)
    for axis in (found.x, found.y):
        assert axis.split is not None
        assert axis.split.offset == pytest.approx(offset, abs=2e-10)
        assert axis.split.gain == pytest.approx(gain, abs=1e-5)
        assert axis.split.shape == pytest.approx(1e-9, rel=0.1)
        assert axis.split.shape_share == axis.split.shape / 40e-6


def test_one_position_has_no_gain() -> None:
    assert measured(1e-9, 1e-9, evolve(SPEC, lines=2)).y.split is None
