"""An effect of another scanner is that of the reference scanner, in other units."""

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import example, given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, prominent_lines
from afm_scan_ros.core.effects.scale import REFERENCE_LENGTH, REFERENCE_VOLTAGE, Scale, scale_of
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, Added, InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.types import Trace
from helpers.scaling import scaled_axis, scaled_trace

PERIOD = 5e-5
AXIS = paper.axis()
sizes = st.floats(-2.0, 2.0).map(lambda power: 10.0**power)
scales = st.builds(Scale, sizes, sizes, sizes)
every_form = pytest.mark.parametrize(
    ("name", "kind"), [(each.name, form.kind) for each in CATALOGUE for form in each.forms]
)


@given(scale=scales)
def test_a_unit_scales_as_its_parts(scale: Scale) -> None:
    length, voltage, time = scale.length, scale.voltage, scale.time
    expected = {
        "1": 1.0,
        "Hz": 1.0 / time,
        "1/s": 1.0 / time,
        "m/s": length / time,
        "V/s": voltage / time,
        "1/m4": length**-4,
        "1/V2": voltage**-2,
    }
    assert {unit: scale.factor(unit) for unit in expected} == pytest.approx(expected)


@given(scale=scales)
def test_a_model_gives_its_scale(scale: Scale) -> None:
    base, found = scale_of(AXIS), scale_of(scaled_axis(AXIS, scale))
    assert found.length / base.length == pytest.approx(scale.length)
    assert found.voltage / base.voltage == pytest.approx(scale.voltage)
    assert found.time / base.time == pytest.approx(scale.time)


def test_the_papers_scanner_has_the_resonance_of_the_reference() -> None:
    own, upper = scale_of(AXIS), AXIS.hysteresis.forward.upper
    assert own.time == pytest.approx(1.0, rel=0.01)
    assert own.voltage * REFERENCE_VOLTAGE == upper
    gain = AXIS.vibration.static_gain * AXIS.hysteresis.forward.chord
    assert own.length * REFERENCE_LENGTH == pytest.approx(gain * upper)


@every_form
@settings(deadline=None, max_examples=3)
@given(scale=scales)
def test_the_motion_of_a_scaled_scanner_is_the_scaled_motion(
    name: str, kind: str, scale: Scale
) -> None:
    form = effect_type(name).form(kind)
    values = [scale.factor(p.unit) * v for p, v in zip(form.parameters, form.example, strict=True)]
    x, y = (paper.smooth_target(seed, 600, 3.0) for seed in (1, 2))
    drive = Trace(0, PERIOD, x, y)
    other = scaled_axis(AXIS, scale)
    base, found = (
        predict(ScannerModel(evolve(axis, added=(Added(name, kind, at),)), axis), driven)
        for axis, at, driven in (
            (AXIS, form.example, drive),
            (other, tuple(values), scaled_trace(drive, scale.voltage, scale.time)),
        )
    )
    np.testing.assert_allclose(
        found.x, scale.length * base.x, rtol=0.0, atol=1e-6 * scale.length * np.ptp(base.x)
    )


@every_form
@settings(deadline=None, max_examples=2)
@given(scale=scales)
def test_a_fit_of_a_scaled_scanner_starts_at_scaled_values(
    name: str, kind: str, scale: Scale
) -> None:
    form, rng = effect_type(name).form(kind), np.random.default_rng(5)
    signals = 1e-6 * rng.standard_normal((3, 2000)).cumsum(axis=1)
    drive = 1e5 * signals[0]
    lines = prominent_lines(signals[1], PERIOD)
    features = ResidualFeatures(PERIOD, drive, signals[0], 1e-2 * signals[1], signals[2], lines)
    other = ResidualFeatures(
        scale.time * PERIOD,
        scale.voltage * drive,
        *(scale.length * signal for signal in (signals[0], 1e-2 * signals[1], signals[2])),
        tuple(line / scale.time for line in lines),
    )
    sizes = [scale.factor(parameter.unit) for parameter in form.parameters]
    expected = [np.array(sizes) * start for start in form.starts(features)]
    np.testing.assert_allclose([*form.at(scale).starts(other)], expected, rtol=1e-4)


@every_form
@settings(deadline=None, max_examples=3)
@example(scale=Scale(time=0.01))  # a fast scanner, of which a corner in Hz would lose the most
@given(scale=scales)
def test_the_drive_of_a_scaled_scanner_is_the_scaled_drive(
    name: str, kind: str, scale: Scale
) -> None:
    """So the inverse errs alike on a fast and on a slow scanner: no number in Hz or s decides."""
    form = effect_type(name).form(kind)
    values = [scale.factor(p.unit) * v for p, v in zip(form.parameters, form.example, strict=True)]
    target = Trace(0, PERIOD, *(paper.smooth_target(seed, 2000, 3e-6) for seed in (1, 2)))
    scaled = scaled_trace(target, scale.length, scale.time)
    other = scaled_axis(AXIS, scale)
    base, found = (
        Compensation(
            ScannerModel(evolve(axis, added=(Added(name, kind, at),)), axis),
            wanted.sample_period,
            INVERSES,
            InverseSettings(),
            DriveLimits(np.inf, np.inf),
        ).whole(wanted)
        for axis, at, wanted in (
            (AXIS, form.example, target),
            (other, tuple(values), scaled),
        )
    )
    np.testing.assert_allclose(
        found.x, scale.voltage * base.x, rtol=0.0, atol=1e-6 * scale.voltage * np.ptp(base.x)
    )
