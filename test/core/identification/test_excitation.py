"""Laws of every calibration drive."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.identification.excitation import (
    PLANS,
    excitation_block,
    hysteresis_plan,
)

WHOLE = {name: excitation_block(plan(), 0, plan().total_samples).x for name, plan in PLANS.items()}


@pytest.mark.parametrize("name", PLANS)
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_any_cut_into_blocks_gives_the_same_drive(name: str, data: st.DataObject) -> None:
    plan, whole = PLANS[name](), WHOLE[name]
    first = data.draw(st.integers(0, plan.total_samples - 1))
    count = data.draw(st.integers(1, 5000))
    block = excitation_block(plan, first, count)
    assert block.first_sample == first
    np.testing.assert_array_equal(block.x, whole[first : first + count])
    np.testing.assert_array_equal(block.y, block.x)


@pytest.mark.parametrize("name", PLANS)
def test_drive_goes_from_rest_to_rest(name: str) -> None:
    plan, whole = PLANS[name](), WHOLE[name]
    assert whole[0] == 0.0
    assert abs(whole[-1]) < 1e-6
    assert len(whole) == plan.total_samples


@pytest.mark.parametrize("name", ["frequency", "hysteresis"])
def test_drive_never_jumps(name: str) -> None:
    assert np.abs(np.diff(WHOLE[name])).max() < 0.1 * np.ptp(WHOLE[name])


def test_creep_is_stepped_within_one_sample_and_left_slowly() -> None:
    moves = np.diff(WHOLE["creep"])
    np.testing.assert_array_equal(moves[moves > 0.0], [0.5, 0.5])
    assert moves.min() > -0.01


def test_ramps_of_the_reversal_curves_stay_below_the_resonance() -> None:
    plan = hysteresis_plan()
    drive = WHOLE["hysteresis"]
    frequency = np.fft.rfftfreq(len(drive), plan.sample_period)
    power = np.abs(np.fft.rfft(drive)) ** 2
    assert power[frequency > 300.0].sum() < 1e-10 * power[1:].sum()


def test_every_level_is_reached_exactly() -> None:
    plan = hysteresis_plan(limit=3.0, levels=7)
    at_turns = plan.voltage(plan.samples)
    np.testing.assert_allclose(at_turns, plan.levels, rtol=0.0, atol=1e-12)
