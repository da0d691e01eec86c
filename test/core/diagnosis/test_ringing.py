"""A floor follows a resonance that an effect has moved."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.discrepancy import VIBRATING, DetectionLimit, with_moved_resonance
from afm_scan_ros.core.effects.vibration import VibrationModel

EDGES = (0.0, 100.0, 300.0, 420.0, 600.0, 850.0, 1200.0)
FLOOR = DetectionLimit(EDGES, np.array([9.0, 3.0, 1.0, 6.0, 0.5, 0.4]), np.full(6, 0.1))
VIBRATES = np.array(EDGES[:-1]) >= VIBRATING


def stage(resonance: float) -> VibrationModel:
    """One resonance (Hz), damped by 1 %."""
    omega = 2.0 * np.pi * resonance
    return VibrationModel([omega**2], [1.0, 0.02 * omega, omega**2])


def test_a_stage_that_vibrates_as_before_leaves_the_floor() -> None:
    assert with_moved_resonance(FLOOR, stage(440.0), stage(440.0)) == pytest.approx(FLOOR.rms)


def test_where_the_resonance_has_come_to_lie_it_is_as_loud_as_it_was() -> None:
    moved = with_moved_resonance(FLOOR, stage(500.0), stage(360.0))
    assert moved[2] == pytest.approx(6.0)
    assert moved[[0, 1, 3]] == pytest.approx(FLOOR.rms[[0, 1, 3]])


@given(st.floats(50.0, 3000.0), st.floats(50.0, 3000.0))
def test_it_sinks_nowhere_and_rises_to_the_loudest_band_at_most(was: float, now: float) -> None:
    moved = with_moved_resonance(FLOOR, stage(was), stage(now))
    assert np.all(moved >= FLOOR.rms)
    assert np.all(moved[~VIBRATES] == FLOOR.rms[~VIBRATES])
    assert moved[VIBRATES].max() == FLOOR.rms[VIBRATES].max()
