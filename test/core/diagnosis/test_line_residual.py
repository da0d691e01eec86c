"""The residual line by line: the same however it is cut, quiet on a healthy scanner, loud else."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.monitor import (
    LineResidual,
    LineResiduals,
    ResidualAlarm,
    ResidualWatch,
    expected_limits,
)
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.mechanisms.electronics import LimitedAmplifier, TiltedSensor
from afm_scan_ros.simulation.mechanisms.structure import RidingMass
from helpers.in_process import ALL, default_model, default_plant, scan

SLOW = ScanSpec(line_rate=5.0, lines=5, samples_per_line=4000)
FAST = ScanSpec(line_rate=100.0, lines=6, samples_per_line=500, turnaround=0.2)


PLANTS = share_directory() / "config/plants"
MECHANISMS = {
    "cross_coupling_tilt": TiltedSensor(axis="x", angle=30e-3),
    "extra_resonance": RidingMass(axis="x", mass_ratio=0.5, frequency=800.0, damping=0.01),
    "slew_limit": LimitedAmplifier(axis="x", current=46e-6, resistance=5.0, capacitance=100e-9),
}
"""Large ones, of which there is no plant file."""


@cache
def scanned(spec: ScanSpec, effect: str = "") -> Scan:
    """Return a scan of the default plant, with a large effect where one is named."""
    if not effect:
        return scan(spec, ALL, plant=default_plant())
    if effect in MECHANISMS:
        return scan(spec, ALL, plant=evolve(default_plant(), mechanisms=(MECHANISMS[effect],)))
    return scan(spec, ALL, plant=load_plant(PLANTS / f"{effect}_large.yaml"))


def residuals(spec: ScanSpec) -> LineResiduals:
    model = default_model()
    return LineResiduals(model, spec, expected_limits(model, spec))


def lines_of(done: Scan) -> list[LineResidual]:
    return list(residuals(done.spec).add(done.drive, done.measured))


def alarms_of(done: Scan) -> list[ResidualAlarm]:
    watch = ResidualWatch()
    for line in lines_of(done):
        watch.news(line)
    return watch.alarms


@pytest.mark.parametrize("spec", [SLOW, FAST], ids=["5 Hz", "100 Hz"])
def test_a_healthy_scanner_raises_no_alarm(spec: ScanSpec) -> None:
    assert alarms_of(scanned(spec)) == []


@pytest.mark.parametrize(
    ("effect", "spec"),
    [
        ("backlash", SLOW),
        ("cross_coupling_tilt", SLOW),
        ("delay", SLOW),
        ("drift", SLOW),
        ("periodic_disturbance_mains", SLOW),
        ("slow_creep_single", SLOW),
        ("extra_resonance", FAST),
        ("slew_limit", FAST),
    ],
)
def test_a_scanner_that_changed_raises_one_on_its_axis(effect: str, spec: ScanSpec) -> None:
    (alarm,) = alarms_of(scanned(spec, effect))
    assert (alarm.axis, alarm.line) == ("x", 2)


def test_each_line_is_measured_less_predicted_without_its_mean() -> None:
    done = scanned(FAST)
    predicted, where = predict(default_model(), done.drive), phases(FAST).lines
    found = lines_of(done)
    assert [line.line for line in found] == list(range(FAST.lines))
    assert [line.first_sample for line in found] == list(where[:: FAST.samples_per_line])
    for axis in ("x", "y"):
        left = (done.measured.axis(axis) - predicted.axis(axis))[where.start : where.stop]
        lines = left.reshape(FAST.lines, -1)
        about = lines - lines.mean(axis=1, keepdims=True)
        expected = np.sqrt(np.mean(about**2, axis=1))
        assert np.allclose([line.axis(axis).rms for line in found], expected, rtol=1e-9)
        largest = np.abs(about).max(axis=1)
        assert np.allclose([line.axis(axis).largest for line in found], largest, rtol=1e-9)


@given(data=st.data())
@settings(deadline=None, max_examples=10)
def test_cuts_change_nothing(data: st.DataObject) -> None:
    done = scanned(FAST)
    total = len(done.drive.x)
    inner = data.draw(st.sets(st.integers(1, total - 1), max_size=6))
    under, found = residuals(FAST), []
    for a, b in pairwise([0, *sorted(inner), total]):
        drive, measured = (
            Trace(a, FAST.sample_period, t.x[a:b], t.y[a:b]) for t in (done.drive, done.measured)
        )
        found += under.add(drive, measured)
    for line, whole in zip(found, lines_of(done), strict=True):
        assert line.first_sample == whole.first_sample
        for axis in ("x", "y"):
            assert line.axis(axis).rms == pytest.approx(whole.axis(axis).rms, rel=1e-6)
            assert line.axis(axis).normalised_residual == pytest.approx(
                whole.axis(axis).normalised_residual, rel=1e-6
            )


def test_a_mean_that_moves_from_line_to_line_is_a_residual_below_the_line_rate() -> None:
    done = scanned(FAST)
    where, size = phases(FAST).lines, FAST.samples_per_line
    numbers = np.clip((np.arange(len(done.drive.x)) - where.start) // size, 0, None)
    x, y = done.measured.x + 200e-9 * numbers, done.measured.y
    stairs = evolve(done, measured=Trace(0, FAST.sample_period, x, y))
    for line, before in zip(lines_of(stairs)[2:], lines_of(done)[2:], strict=True):
        assert line.x.rms == pytest.approx(before.x.rms, rel=1e-6)
        assert line.x.band == (0.0, 50.0)
        assert line.x.normalised_residual > 5.0
        assert line.y == before.y


def test_a_drive_beyond_the_identified_range_predicts_nothing() -> None:
    beyond = Trace(0, FAST.sample_period, np.array([0.0, 4.5]), np.zeros(2))
    with pytest.raises(BeyondRangeError):
        list(residuals(FAST).add(beyond, beyond))


def test_a_model_of_unmodel_discrepancy_is_refused() -> None:
    model = default_model()
    unknown = evolve(model, y=evolve(model.y, model_discrepancy=None))
    with pytest.raises(InputError, match=r"axis y states no model_discrepancy.*identify it anew"):
        expected_limits(unknown, FAST)
