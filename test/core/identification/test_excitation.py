"""Laws of every calibration drive."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import (
    PLANS,
    excitation_block,
)
from afm_scan_ros.core.identification.drives.waveforms import waypoints
from afm_scan_ros.core.identification.records.recording import checked
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Trace
from helpers.in_process import default_plant, drive_through


@cache
def whole_drive(name: str) -> Trace:
    plan = PLANS[name]()
    return excitation_block(plan, 0, plan.total_samples)


@pytest.mark.parametrize("name", PLANS)
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_any_cut_into_blocks_gives_the_same_drive(name: str, data: st.DataObject) -> None:
    plan, whole = PLANS[name](), whole_drive(name)
    first = data.draw(st.integers(0, plan.total_samples - 1))
    count = data.draw(st.integers(1, 5000))
    block = excitation_block(plan, first, count)
    assert block.first_sample == first
    for axis in AXES:
        np.testing.assert_array_equal(block.axis(axis), whole.axis(axis)[first : first + count])


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("axis", AXES)
def test_drive_goes_from_rest_to_rest(name: str, axis: str) -> None:
    drive = whole_drive(name).axis(axis)
    assert drive[0] == 0.0
    assert abs(drive[-1]) < 1e-6
    assert len(drive) == PLANS[name]().total_samples


@pytest.mark.parametrize("name", ["frequency", "hysteresis"])
@pytest.mark.parametrize("axis", AXES)
def test_drive_never_jumps(name: str, axis: str) -> None:
    drive = whole_drive(name).axis(axis)
    assert np.abs(np.diff(drive)).max() < 0.1 * np.ptp(drive)


@pytest.mark.parametrize("name", PLANS)
def test_a_record_of_the_other_axis_is_named(name: str) -> None:
    drive, displacement = drive_through(PLANS[name](), default_plant(), seed=1)
    with_form = Trace(0, displacement.sample_period, displacement.y, displacement.x)
    with pytest.raises(InputError, match="displacement x follows drive y"):
        checked(Record.of_traces(name, drive, with_form))


def test_creep_is_stepped_within_one_sample_and_left_slowly() -> None:
    up, down = np.diff(whole_drive("creep").x), np.diff(whole_drive("creep").y)
    np.testing.assert_array_equal(up[up > 0.0], [0.5, 0.5])
    assert up.min() > -0.01
    np.testing.assert_array_equal(down[down != 0.0], [-0.5, 0.5])
    np.testing.assert_array_equal(np.flatnonzero(down), np.flatnonzero(up > 0.0))


@pytest.mark.parametrize("axis", AXES)
def test_the_slowest_moves_between_levels_do_not_strike_the_resonance(axis: str) -> None:
    drive, period = whole_drive("hysteresis").axis(axis), whole_drive("hysteresis").sample_period
    slow = drive[: round(3.0 / period)]
    frequency = np.fft.rfftfreq(len(slow), period)
    power = np.abs(np.fft.rfft(slow * np.hanning(len(slow)))) ** 2
    assert power[frequency > 300.0].sum() < 1e-6 * power[1:].sum()


def test_every_level_is_reached_exactly() -> None:
    levels, samples = np.array([0.0, 1.5, -2.0, 0.0]), np.array([0.0, 100.0, 350.0, 600.0])
    drive = waypoints(levels, samples, blend=20.0)
    np.testing.assert_allclose(drive[samples.astype(int)], levels, rtol=0.0, atol=1e-12)
