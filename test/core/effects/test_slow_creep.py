"""Slow creep against its equation: sections in series with the scanner, what has crept included."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.slow_creep import REACH, NortonCreep
from afm_scan_ros.core.types import Array
from helpers.in_process import default_model

PERIOD = 1e-3
STEP = np.ones(20_000)
MODEL = default_model().x


def step_response(kind: str, *values: float) -> Array:
    """What creep, the model's and the added, makes of a step of 1 m."""
    chain = effect_type("slow_creep").form(kind).insert(Chain(MODEL), np.array(values))
    (added,) = (element.at(PERIOD) for element in chain.output)
    base = Creep(chain.model.creep, PERIOD)
    moved = base.apply(base.at_rest(), STEP)[1]
    return np.asarray(added.apply(added.at_rest(), moved)[1])


def test_a_section_follows_all_that_the_scanner_does() -> None:
    gain, constant = 0.2, 0.7
    time = PERIOD * np.arange(len(STEP))
    base = [1.0 - np.exp(-time / tau) for tau in MODEL.creep.time_constants]
    moved = 1.0 + np.array(MODEL.creep.gains) @ base
    _, crept, _ = lsim(([gain], [constant, 1.0]), moved, time)
    np.testing.assert_allclose(step_response("", gain, constant), moved + crept, atol=2e-4)


def test_logarithmic_creep_gains_as_much_in_each_decade() -> None:
    grown = step_response("logarithmic", 0.01, 1e-2)
    alone = step_response("logarithmic", 0.0, 1e-2)
    decades = (grown - alone)[[50, 500, 5_000]] / alone[[50, 500, 5_000]]
    np.testing.assert_allclose(np.diff(decades), 0.02, rtol=0.05)


@settings(deadline=None, max_examples=20)
@given(power=st.floats(1.0, 7.0), constant=st.floats(0.05, 5.0), rate=st.floats(1.0, 50.0))
def test_creep_by_a_power_follows_its_equation(power: float, constant: float, rate: float) -> None:
    time = PERIOD * np.arange(2_000)
    moved = 20e-6 * np.sin(rate * time)
    creep = NortonCreep(0.1, constant, power, REACH, PERIOD)
    found = creep.apply(creep.at_rest(), moved)[1]

    def slope(t: float, z: Array) -> Array:
        stress = 20.0 * np.sin(rate * t) - z
        return stress * np.abs(stress / (1e6 * REACH)) ** (power - 1.0) / constant

    golden = solve_ivp(slope, (0.0, time[-1]), [0.0], t_eval=time, rtol=1e-8, atol=1e-8)
    lost = 1e6 * (found - moved) - 0.1 * golden.y[0]
    held = 0.1 * 20.0 * rate * PERIOD  # um, as x is held
    assert np.abs(lost).max() <= held + 1e-6


def test_creep_by_the_power_one_is_that_of_one_section() -> None:
    linear, power = step_response("", 0.2, 0.7), step_response("power", 0.2, 0.7, 1.0)
    np.testing.assert_allclose(power, linear, rtol=1e-12)
