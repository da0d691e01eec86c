"""An effect of another scanner is that of the reference scanner, in other units."""

from collections.abc import Sequence

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
from afm_scan_ros.core.types import Array, Trace
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


def added(name: str, kind: str, scale: Scale) -> Added:
    """Effect of a size that a scanner may show, on a scanner of a scale."""
    form = effect_type(name).form(kind)
    pairs = zip(form.parameters, form.example, strict=True)
    return Added(name, kind, tuple(scale.factor(p.unit) * value for p, value in pairs))


def played(effects: Sequence[tuple[str, str]], scale: Scale) -> tuple[Array, Array]:
    """Motion (2, n) of a scanner of a scale under a drive, and its drive for a target.

    The axes have the effects, x also what couples it to y.
    """
    axis = scaled_axis(AXIS, scale)
    of_both = [each for each in effects if each[0] != "cross_coupling"]
    model = ScannerModel(
        *(evolve(axis, added=[added(*e, scale) for e in each]) for each in (effects, of_both))
    )
    drive, target = (
        Trace(0, PERIOD, *(paper.smooth_target(seed, 1500, size) for seed in (1, 2)))
        for size in (3.0, 3e-6)
    )
    moved = predict(model, scaled_trace(drive, scale.voltage, scale.time))
    limits, settings = DriveLimits(np.inf, np.inf), InverseSettings()
    wanted = scaled_trace(target, scale.length, scale.time)
    inverse = Compensation(model, wanted.sample_period, INVERSES, settings, limits)
    driven = inverse.whole(wanted)
    return np.stack((moved.x, moved.y)), np.stack((driven.x, driven.y))


def same_but_for_scale(effects: Sequence[tuple[str, str]], scale: Scale) -> None:
    sizes = scale.length, scale.voltage
    for found, base, size in zip(
        played(effects, scale), played(effects, Scale()), sizes, strict=True
    ):
        assert np.abs(found / size - base).max() <= 1e-9 * np.ptp(base)


@every_form
@settings(deadline=None, max_examples=3)
@example(scale=Scale(time=0.01))  # a fast scanner, of which a corner in Hz would lose the most
@given(scale=scales)
def test_a_scaled_scanner_moves_and_is_driven_as_the_other(
    name: str, kind: str, scale: Scale
) -> None:
    """So the inverse errs alike on a fast and on a slow scanner: no number in Hz or s decides."""
    same_but_for_scale([(name, kind)], scale)


CHAINS = (
    [
        ("slew_limit", "resistive"),
        ("input_lag", ""),
        ("static_nonlinearity", "drive"),
        ("rate_dependent_hysteresis", "activated"),
        ("delay", ""),
        ("extra_resonance", "absorber_mode"),
        ("cross_coupling", "modal"),
        ("slow_creep", "power"),
        ("drift", "logarithmic"),
    ],
    [
        ("extra_resonance", "drive"),
        ("rate_dependent_hysteresis", ""),
        ("parameter_shift", "warmth"),
        ("cross_coupling", "coupled_mode"),
        ("hysteretic_stiffness", "spectrum"),
        ("static_nonlinearity", "quintic"),
        ("backlash", ""),
        ("periodic_disturbance", "hum"),
    ],
)


@pytest.mark.parametrize("effects", CHAINS, ids=["first", "second"])
@settings(deadline=None, max_examples=4)
@example(scale=Scale(0.01, 0.01, 0.01))
@example(scale=Scale(100.0, 100.0, 100.0))
@given(scale=scales)
def test_so_does_a_scanner_with_effects_in_all_places(
    effects: list[tuple[str, str]], scale: Scale
) -> None:
    same_but_for_scale(effects, scale)


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
