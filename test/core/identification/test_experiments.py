"""Laws of every experiment: what it asks of the scanner, and that its axes are distinguished."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS, excitation_block
from afm_scan_ros.core.identification.drives.experiments import (
    EXPERIMENTS,
    KINDS,
    SWEEPS,
    resampled,
)
from afm_scan_ros.core.identification.local_response import local_response
from afm_scan_ros.core.model import EverettSurface, HysteresisModel, ScannerModel
from afm_scan_ros.core.types import AXES
from helpers.in_process import default_model, default_plant, drive_through, record
from helpers.scaling import scaled_axis

WHOLE = {
    name: excitation_block(each.plan(), 0, each.plan().total_samples)
    for name, each in EXPERIMENTS.items()
}
MOVING = [name for name in EXPERIMENTS if name != "rest"]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_it_is_what_a_scanner_and_a_lab_can_bear(name: str) -> None:
    plan, drive = EXPERIMENTS[name].plan(), WHOLE[name]
    assert plan.name == name
    assert plan.total_samples <= 1_500_000
    assert plan.total_samples * plan.sample_period <= (600.0 if name == "hold" else 60.0)
    for axis in AXES:
        volts = drive.axis(axis)
        assert np.abs(volts).max() <= 3.6
        assert np.abs(np.diff(volts)).max() <= 2e5 * plan.sample_period


@pytest.mark.parametrize("name", EXPERIMENTS)
@pytest.mark.parametrize("axis", AXES)
def test_drive_goes_from_rest_to_rest(name: str, axis: str) -> None:
    drive, samples = WHOLE[name].axis(axis), round(0.4 / WHOLE[name].sample_period)
    assert np.abs(drive[:samples]).max() < 1e-9
    assert np.abs(drive[-samples:]).max() < 1e-9


@pytest.mark.parametrize("name", MOVING)
def test_axes_move_unlike_each_other(name: str) -> None:
    x, y = (np.diff(WHOLE[name].axis(axis)) for axis in AXES)
    assert abs(x @ y) < 0.1 * np.linalg.norm(x) * np.linalg.norm(y)


def test_one_axis_rests_while_the_other_moves() -> None:
    drive = WHOLE["one_axis"]
    assert np.all((drive.x == 0.0) | (drive.y == 0.0))
    assert np.ptp(drive.x) == np.ptp(drive.y) > 5.0


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_scanner_ends_about_where_it_began(name: str) -> None:
    """Creep remains, and the remanence of a sweep's last sine."""
    _, displacement = drive_through(EXPERIMENTS[name].plan(), default_plant(), seed=1)
    for axis in AXES:
        moved = displacement.axis(axis)
        assert abs(moved[-1]) < max(0.05 * np.ptp(moved), 20e-9)


def test_no_experiment_has_a_records_name() -> None:
    assert len(KINDS) == len(PLANS) + len(EXPERIMENTS)
    assert all(each.purpose for each in EXPERIMENTS.values())


@pytest.mark.parametrize("name", SWEEPS)
@pytest.mark.parametrize("axis", AXES)
def test_sweeps_show_the_resonance(name: str, axis: str) -> None:
    seen = record(EXPERIMENTS[name].plan(), default_plant(), seed=1)
    drive, moved = seen.signals(axis)
    found = local_response(drive, drive, moved, seen.sample_period)
    poles = np.roots(default_plant().axes()[axis].vibration.denominator)
    least = abs(poles[np.argmin(-poles.real / np.abs(poles))]) / (2.0 * np.pi)
    told = (found.coherence > 0.9) & (found.frequency > 100.0)
    size = np.where(told, np.abs(found.response), 0.0)
    assert found.frequency[size.argmax()] == pytest.approx(least, rel=0.01)


@pytest.mark.parametrize("name", EXPERIMENTS)
@pytest.mark.parametrize("scale", [Scale(0.1, 20.0, 0.03), Scale(3.0, 0.2, 4.0)])
def test_a_drive_takes_the_same_part_of_any_scanners_range(name: str, scale: Scale) -> None:
    axis = default_model().x
    before = EXPERIMENTS[name].plan_for(ScannerModel(x=axis))
    plan = EXPERIMENTS[name].plan_for(ScannerModel(x=scaled_axis(axis, scale)))
    time = scale.time if EXPERIMENTS[name].stage else 1.0
    assert plan.sample_period == pytest.approx(time * before.sample_period)
    assert plan.x == pytest.approx(scale.voltage * before.x)
    assert not plan.y.any()


def test_a_unipolar_scanner_is_driven_about_its_middle() -> None:
    forward = default_model().x.hysteresis.forward
    raised = EverettSurface(0.0, 100.0, forward.values, forward.offset)
    axis = evolve(default_model().x, hysteresis=HysteresisModel(raised, raised))
    for each in EXPERIMENTS.values():
        plan = each.plan_for(ScannerModel(x=axis))
        assert plan.x[[0, -1]] == pytest.approx(0.0, abs=1e-9)
        assert plan.x.min() >= 0.0
        assert plan.x.max() <= 100.0


@pytest.mark.parametrize("name", ["broadband", "hold", "chirp"])
@pytest.mark.parametrize("share", [0.37, 1.9])
def test_a_drive_at_another_rate_is_the_same_voltage_against_time(name: str, share: float) -> None:
    plan = EXPERIMENTS[name].plan()
    other = resampled(plan, share / plan.sample_period)
    assert other.duration == pytest.approx(plan.duration, abs=2.0 * other.sample_period)
    there, here = other.x, plan.x
    time = other.sample_period * np.arange(len(there))
    linear = np.interp(time, plan.sample_period * np.arange(len(here)), here)
    assert np.abs(there - linear).max() < 0.1 * np.abs(here).max()
    assert np.sqrt(np.mean((there - linear) ** 2)) < 0.01 * np.sqrt(np.mean(here**2))
    assert there[-1] == here[-1]


def test_a_drive_that_is_too_fast_for_a_rate_is_refused_and_the_least_rate_is_taken() -> None:
    plan = EXPERIMENTS["broadband"].plan()
    with pytest.raises(InputError, match="give at least 400") as refused:
        resampled(plan, 3000.0)
    least = float(str(refused.value).split("at least ")[1].split(",")[0])
    assert resampled(plan, least).sample_period == pytest.approx(1.0 / least)
