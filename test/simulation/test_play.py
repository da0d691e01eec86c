"""Laws of the plays: memory without time, wiping-out, hysteresis however small the drive."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import HysteresisSpec, PlayBank
from afm_scan_ros.simulation.scanner import PlantSpec

SPEC = HysteresisSpec(
    elements=80,
    threshold_max=5.0,
    density=1.5,
    decay=1.0,
    gain=0.65,
    input_quadratic=-0.008,
    output_quadratic=-0.0025,
)
BANK = PlayBank.from_spec(SPEC)

voltages = st.floats(-4.0, 4.0)
drives = arrays(float, st.integers(1, 40), elements=voltages)


@settings(deadline=None)
@given(drives, drives)
def test_cutting_into_blocks_changes_nothing(first: Array, second: Array) -> None:
    _, whole = BANK.apply(BANK.relaxed(), np.concatenate([first, second]))
    between, begin = BANK.apply(BANK.relaxed(), first)
    kept = between.copy()
    _, end = BANK.apply(between, second)
    np.testing.assert_array_equal(np.concatenate([begin, end]), whole)
    np.testing.assert_array_equal(between, kept)


@settings(deadline=None)
@given(drives, st.integers(2, 5))
def test_output_does_not_depend_on_the_rate(drive: Array, slower: int) -> None:
    _, fast = BANK.apply(BANK.relaxed(), drive)
    steps = np.arange(slower * drive.size) / slower
    stretched = np.interp(steps, np.arange(drive.size), drive)
    stretched[::slower] = drive
    _, slow = BANK.apply(BANK.relaxed(), stretched)
    np.testing.assert_allclose(slow[::slower], fast, rtol=0, atol=1e-12)


@settings(deadline=None)
@given(drives, st.floats(-3.6, 3.6))  # so that the corner's field exceeds the turn's
def test_a_closed_excursion_is_forgotten(history: Array, turn: float) -> None:
    corner = np.copysign(4.0, -turn)
    before, reached = BANK.apply(BANK.relaxed(), np.append(history, corner))
    after, excursion = BANK.apply(before, np.array([turn, corner]))
    np.testing.assert_allclose(after, before, atol=1e-12)
    assert excursion[-1] == pytest.approx(reached[-1], abs=1e-12)


@pytest.mark.parametrize("amplitude", [0.01, 0.04, 0.2])
def test_small_loops_obey_rayleighs_law(amplitude: float) -> None:
    """Opening at zero drive: gain x 2 x integral of density x min(r, A - r), r from 0 to A."""
    path = np.array([0.0, 1.0, -1.0, 0.0, 1.0, 0.0]) * amplitude
    _, effective = BANK.apply(BANK.relaxed(), path)
    expected = SPEC.gain * SPEC.density * amplitude**2 / 2.0 * np.exp(-amplitude / 2.0)
    assert effective[5] - effective[3] == pytest.approx(expected, rel=0.02)


def test_without_plays_the_output_is_both_quadratics() -> None:
    bank = PlayBank.from_spec(HysteresisSpec(1, 1.0, 0.0, 1.0, 2.0, 0.5, 0.25))
    _, effective = bank.apply(bank.relaxed(), np.array([1.0, -4.0]))
    np.testing.assert_array_equal(effective, [3.0 + 0.5625, 8.0 + 4.0])


def test_a_virgin_scanner_that_is_not_driven_does_not_move(plant: PlantSpec) -> None:
    bank = PlayBank.from_spec(plant.x.hysteresis)
    plays, effective = bank.apply(bank.relaxed(), np.zeros(3))
    assert not plays.any()
    assert not effective.any()
