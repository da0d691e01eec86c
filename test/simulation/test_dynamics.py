"""Laws of the linear part: exact between updates, linear, and the paper's response."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import linalg, signal

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import Dynamics, RationalSpec, highest_peak
from afm_scan_ros.simulation.scanner import PlantSpec

PERIOD = 2e-5
NONE = RationalSpec((1.0,), (1.0,))

inputs = arrays(float, st.integers(1, 60), elements=st.floats(-6.0, 6.0))


@pytest.fixture(scope="module")
def dynamics(plant: PlantSpec) -> Dynamics:
    return Dynamics.from_spec(plant.x, plant.sensor_sensitivity)


def run(dynamics: Dynamics, effective: Array, period: float = PERIOD) -> Array:
    return dynamics.apply(dynamics.at_rest(), effective, period)[1]


@settings(deadline=None)
@given(first=inputs, second=inputs)
def test_cutting_into_blocks_changes_nothing(
    dynamics: Dynamics, first: Array, second: Array
) -> None:
    between, begin = dynamics.apply(dynamics.at_rest(), first, PERIOD)
    kept = between.copy()
    _, end = dynamics.apply(between, second, PERIOD)
    whole = run(dynamics, np.concatenate([first, second]))
    np.testing.assert_array_equal(np.concatenate([begin, end]), whole)
    np.testing.assert_array_equal(between, kept)


@settings(deadline=None)
@given(effective=inputs, finer=st.integers(2, 7))
def test_finer_steps_change_nothing(dynamics: Dynamics, effective: Array, finer: int) -> None:
    fine = run(dynamics, np.repeat(effective, finer), PERIOD / finer)
    np.testing.assert_allclose(fine[::finer], run(dynamics, effective), rtol=0, atol=1e-16)


@settings(deadline=None)
@given(one=inputs, factor=st.floats(-3.0, 3.0))
def test_responses_superpose(dynamics: Dynamics, one: Array, factor: float) -> None:
    other = np.cos(np.arange(one.size))
    apart = run(dynamics, one) + factor * run(dynamics, other)
    np.testing.assert_allclose(run(dynamics, one + factor * other), apart, rtol=0, atol=1e-17)


def test_a_sample_is_taken_before_the_update(dynamics: Dynamics) -> None:
    moved = run(dynamics, np.array([0.0, 1.0, 0.0]))
    assert moved[0] == moved[1] == 0.0
    assert moved[2] != 0.0


def test_vibration_is_the_exponential_of_its_state_matrix(plant: PlantSpec) -> None:
    vibration = plant.x.vibration
    dynamics = Dynamics.from_spec(evolve(plant.x, modes=(), creep=NONE), 1.0)
    a, b, c, _ = signal.tf2ss(vibration.numerator, vibration.denominator)
    step = linalg.expm(np.block([[a, b], [np.zeros((1, 5))]]) * PERIOD)
    effective = np.sin(np.arange(300.0) ** 1.3)
    state, expected = np.zeros(4), []
    for held in effective:
        expected.append((c @ state)[0])
        state = (step @ np.append(state, held))[:4]
    np.testing.assert_allclose(run(dynamics, effective), expected, rtol=0, atol=1e-9)


def test_an_hour_of_creep_is_the_analytic_step_response(plant: PlantSpec) -> None:
    """The paper's Eqs. 5 and 6 expanded by scipy, not by the plant."""
    dynamics = Dynamics.from_spec(evolve(plant.x, modes=()), 1.0)
    last = run(dynamics, np.ones(360_001), 0.01)[-1]
    residues, poles, _ = signal.residue(plant.x.creep.numerator, plant.x.creep.denominator)
    crept = 1.0 + np.sum(residues / poles * np.expm1(poles * 3600.0)).real
    assert last == pytest.approx(1.07e14 / 1.55e14 * crept, rel=1e-9)


@settings(deadline=None)
@given(hertz=st.floats(1e-4, 5e3))
def test_response_is_the_papers_with_the_modes(plant: PlantSpec, hertz: float) -> None:
    dynamics = Dynamics.from_spec(plant.y, plant.sensor_sensitivity)
    s = 2j * np.pi * hertz
    vibration, creep, mode = plant.y.vibration, plant.y.creep, plant.y.modes[0]
    own = 2.0 * np.pi * mode.frequency
    static = 0.06 * highest_peak(vibration) * 2.0 * mode.damping * np.sqrt(1.0 - mode.damping**2)
    expected = np.polyval(vibration.numerator, s) / np.polyval(vibration.denominator, s)
    expected += static * own**2 / (s**2 + 2.0 * mode.damping * own * s + own**2)
    expected *= 8.0e-6 * np.polyval(creep.numerator, s) / np.polyval(creep.denominator, s)
    found = dynamics.response(np.array([2.0 * np.pi * hertz]))[0]
    assert found == pytest.approx(expected, rel=1e-9)


def test_first_resonance_is_at_454_hz(dynamics: Dynamics) -> None:
    """The paper, Section 2.3."""
    hertz = np.arange(400.0, 500.0, 0.1)
    peak = hertz[np.abs(dynamics.response(2.0 * np.pi * hertz)).argmax()]
    assert peak == pytest.approx(454.0, abs=0.5)
