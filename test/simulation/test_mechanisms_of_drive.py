"""Mechanisms before and in the hysteresis, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.electronics import (
    DelayedConverter,
    LaggingAmplifier,
    LimitedAmplifier,
)
from afm_scan_ros.simulation.mechanisms.material import ViscousBlocks
from afm_scan_ros.simulation.scanner import PlantSpec

STEP = 5e-6


def act(insert: Insert, own: Array) -> Array:
    state = insert.at_rest(STEP, np.random.default_rng(0))
    return insert.act(state, own, np.zeros_like(own), STEP)[1]


@settings(deadline=None)
@given(delay=st.floats(0.0, 1e-4))
def test_a_delay_keeps_the_area(delay: float) -> None:
    pulse = np.zeros(60)
    pulse[3:9] = 1.0
    leaving = act(DelayedConverter(axis="x", delay=delay), pulse)
    assert leaving.sum() == pytest.approx(6.0)
    centre = np.arange(60) @ leaving / 6.0
    assert centre == pytest.approx(5.5 + delay / STEP)


def test_an_amplifier_charges_as_an_exponential() -> None:
    constant = 40e-6
    mean = act(LaggingAmplifier(axis="x", resistance=400.0, capacitance=100e-9), np.ones(100))
    edges = np.exp(-STEP / constant * np.arange(101))
    np.testing.assert_allclose(mean, 1.0 + np.diff(edges) * constant / STEP, rtol=1e-9)


def test_an_amplifier_with_current_enough_is_not_limited() -> None:
    drive = np.sin(np.arange(300.0))
    parts = {"resistance": 400.0, "capacitance": 100e-9}
    free = act(LaggingAmplifier(axis="x", **parts), drive)
    limited = act(LimitedAmplifier(axis="x", current=1.0, **parts), drive)
    np.testing.assert_allclose(limited, free, atol=1e-12)


def test_a_limited_amplifier_runs_straight_to_within_its_resistance() -> None:
    amplifier = LimitedAmplifier(axis="x", current=50e-6, resistance=400.0, capacitance=100e-9)
    drive = np.full(1000, 1.0)
    fine = 1e-9 * np.arange(int(1000 * STEP / 1e-9))
    meets = (1.0 - 50e-6 * 400.0) / 500.0
    expected = np.where(fine < meets, 500.0 * fine, 1.0 - 0.02 * np.exp(-(fine - meets) / 4e-5))
    mean = expected.reshape(1000, -1).mean(axis=1)
    np.testing.assert_allclose(act(amplifier, drive), mean, atol=1e-6)


def test_thin_films_drag_no_blocks(plant: PlantSpec) -> None:
    plays = PlayBank.from_spec(plant.x.hysteresis)
    drive = 3.0 * np.sin(np.arange(2000) * 0.01)
    thin = ViscousBlocks(axis="x", time_constant=1e-9).bank(plays, STEP)
    _, free = plays.apply(plays.relaxed(), drive)
    np.testing.assert_allclose(thin.apply(thin.relaxed(), drive)[1], free, atol=1e-3)


def test_blocks_catch_up_once_the_drive_holds(plant: PlantSpec) -> None:
    plays = PlayBank.from_spec(plant.x.hysteresis)
    drive = np.concatenate((np.linspace(0.0, 3.0, 100), np.full(2000, 3.0)))
    film = ViscousBlocks(axis="x", time_constant=2e-4).bank(plays, STEP)
    _, free = plays.apply(plays.relaxed(), drive)
    _, dragged = film.apply(film.relaxed(), drive)
    assert free[99] - dragged[99] > 0.5
    assert dragged[-1] == pytest.approx(free[-1], abs=1e-9)
