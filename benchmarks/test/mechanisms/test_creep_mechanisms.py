"""Mechanisms of creep.py, each against the solution of its equation."""

import numpy as np
import pytest
from scipy import integrate

from afm_scan_bench.mechanisms.creep import (
    SOLDER_REACH,
    DrainingPad,
    PolymerPad,
    RelaxingClamp,
    SolderedJoint,
)
from afm_scan_ros.core.types import Array
from helpers.acting import STEP, TIME, WAVE, act


def test_a_pad_creeps_by_a_power_of_time() -> None:
    crept = act(PolymerPad(axis="x", share=0.05, power=0.25), np.ones(20_000), step=1e-3) - 1.0
    time = 1e-3 * np.arange(1, 20_001)
    ratio = crept / (0.05 * time**0.25)
    assert ratio[999] == pytest.approx(1.0, rel=0.02)
    slope = np.polyfit(np.log(time[50:]), np.log(crept[50:]), 1)[0]
    assert slope == pytest.approx(0.25, abs=0.04)


def test_a_clamp_gives_way_the_slower_the_further_it_has() -> None:
    clamp = RelaxingClamp(axis="x", scale=1e-7, settling=0.5)
    moved, time = act(clamp, np.zeros(2001), step=1e-3), 1e-3 * np.arange(2001)
    found = integrate.solve_ivp(
        lambda _, z: 1e-7 / 0.5 * np.exp(-z / 1e-7),
        (0.0, 2.0),
        [0.0],
        "LSODA",
        time,
        rtol=1e-9,
        atol=1e-18,
    )
    np.testing.assert_allclose(moved, found.y[0], atol=1e-13)


def test_solder_creeps_by_the_cube_of_its_stress() -> None:
    joint = SolderedJoint(axis="x", share=0.5, settling=2e-3)

    def creep(t: float, z: Array) -> Array:
        return np.asarray((np.interp(t, TIME, WAVE) - z) ** 3 / (2e-3 * SOLDER_REACH**2))

    found = integrate.solve_ivp(
        creep, (0.0, TIME[-1]), [0.0], "DOP853", TIME, max_step=STEP, rtol=1e-9, atol=1e-15
    )
    np.testing.assert_allclose(act(joint, WAVE), WAVE + 0.5 * found.y[0], atol=1e-13)


def test_a_pad_settles_as_its_water_drains() -> None:
    """Against a column of many layers, of which each passes its water on to the next."""
    layers, draining = 300, 2e-3
    column = np.diag(np.full(layers, 2.0)) - np.eye(layers, k=1) - np.eye(layers, k=-1)
    column[0, 0], column[-1, -1] = 3.0, 1.0  # half a layer from the drain; a closed end
    rates, shapes = np.linalg.eigh(column * layers**2 / draining)
    shares = shapes.sum(axis=0) ** 2 / layers
    steps, pace = np.exp(-rates * STEP), np.diff(WAVE, prepend=0.0) / STEP
    pressure, settled = np.zeros(layers), []
    for speed in pace:
        pressure = steps * pressure + speed * (1.0 - steps) / rates
        settled.append(shares @ pressure)
    expected = WAVE + 0.5 * (WAVE - settled)
    pad = DrainingPad(axis="x", share=0.5, draining=draining)
    np.testing.assert_allclose(act(pad, WAVE), expected, atol=2e-5 * 1e-6)


@pytest.mark.parametrize("degree", [0.05, 0.2, 0.5])
def test_a_loaded_pad_settles_by_the_root_of_time_at_first(degree: float) -> None:
    pad, time = DrainingPad(axis="x", share=1.0, draining=1.0), 0.25 * np.pi * degree**2
    given_way = act(pad, np.ones(1001), step=time / 1000)[-1] - 1.0
    assert given_way == pytest.approx(degree, rel=5e-3)
