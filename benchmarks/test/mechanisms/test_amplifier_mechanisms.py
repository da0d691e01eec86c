"""Mechanisms of amplifier.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, linalg, signal

from afm_scan_bench.mechanisms.amplifier import (
    SUPPLY,
    BufferedAmplifier,
    CompressingAmplifier,
    RingingAmplifier,
    SelfHeatingAmplifier,
    SingleEndedAmplifier,
    StarvedAmplifier,
    TiredAmplifier,
)
from afm_scan_ros.core.types import Array
from helpers.acting import STEP, TIME, act


def test_two_stages_charge_by_their_matrix() -> None:
    amplifier = BufferedAmplifier(axis="x", slower=40e-6, ratio=0.25)
    flow = np.array([[-1e5, 0.0, 1e5], [2.5e4, -2.5e4, 0.0], [0.0, 0.0, 0.0]])
    fine, means = np.array([0.0, 0.0, 1.0]), []
    step = linalg.expm(flow * STEP / 100)
    for _ in range(40):
        inside = []
        for _ in range(100):
            before, fine = fine, step @ fine
            inside.append(0.5 * (before[1] + fine[1]))
        means.append(np.mean(inside))
    np.testing.assert_allclose(act(amplifier, np.ones(40)), means, atol=1e-6)


def test_a_tired_amplifier_follows_its_equation() -> None:
    amplifier = TiredAmplifier(axis="x", current=1e-3, resistance=300.0, capacitance=100e-9)

    def charge(_: float, v: Array) -> Array:
        return np.asarray(1e-3 * np.tanh((1.0 - v) / 0.3) / 100e-9)

    ends = STEP * np.arange(61)
    found = integrate.solve_ivp(charge, (0.0, ends[-1]), [0.0], "LSODA", ends, rtol=1e-9, atol=1e-9)
    v = found.y[0]
    np.testing.assert_allclose(act(amplifier, np.ones(60)), 0.5 * (v[1:] + v[:-1]), atol=1e-6)


@given(st.floats(-5.0, 5.0), st.floats(5.5, 100.0))
def test_an_amplifier_compresses_towards_its_rails(volt: float, rail: float) -> None:
    (out,) = act(CompressingAmplifier(axis="x", rail=rail), np.array([volt]))
    expected = volt - volt**3 / (3.0 * rail**2)
    assert abs(out) <= abs(volt) + 1e-15  # rounding
    assert out == pytest.approx(expected, abs=2.0 / 15.0 * abs(volt) ** 5 / rail**4 + 1e-12)


def test_an_amplifier_rings_by_its_transfer_function() -> None:
    natural = 2.0 * np.pi * 1200.0
    rung = act(RingingAmplifier(axis="x", frequency=1200.0, damping=0.05), np.ones(4000))
    system = signal.lti([natural**2], [1.0, 0.1 * natural, natural**2])
    fine = np.linspace(0.0, 4000 * STEP, 4000 * 10 + 1)
    v = signal.step(system, T=fine)[1]
    mean = [integrate.simpson(v[10 * k : 10 * k + 11]) / 10.0 for k in range(4000)]
    np.testing.assert_allclose(rung, mean, atol=1e-8)


def test_a_single_ended_amplifier_rises_at_once_and_falls_as_its_resistor_lets_it() -> None:
    amplifier = SingleEndedAmplifier(axis="x", pull=1e3, capacitance=1e-7)
    out = act(amplifier, np.repeat([2.0, -1.0, 1.0], 40))
    np.testing.assert_allclose(out[:40], 2.0)
    np.testing.assert_allclose(out[80:], 1.0)
    fine = np.linspace(0.0, 40 * STEP, 40_001)
    falling = np.maximum((2.0 + SUPPLY) * np.exp(-fine / 1e-4) - SUPPLY, -1.0)
    mean = [integrate.trapezoid(falling[1000 * k : 1000 * k + 1001]) / 1000 for k in range(40)]
    np.testing.assert_allclose(out[40:80], mean, atol=1e-6)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), pull=st.floats(1.0, 1e6))
def test_a_piezo_that_discharges_is_never_below_the_drive(seed: int, pull: float) -> None:
    drive = np.random.default_rng(seed).uniform(-5.0, 5.0, 200)
    amplifier = SingleEndedAmplifier(axis="x", pull=pull, capacitance=1e-7)
    out = act(amplifier, drive)
    assert np.all(out >= drive - 1e-12)
    assert np.all(out <= np.maximum.accumulate(np.maximum(drive, 0.0)) + 1e-12)


def test_an_output_stage_heats_the_input_stage() -> None:
    drive = 12.0 * np.sin(TIME[:600] / 3e-4)
    amplifier = SelfHeatingAmplifier(axis="x", offset=0.1, settling=1e-3)

    def warm(t: float, s: Array) -> list[float]:
        held = abs(drive[min(int(t / STEP), 599)])
        return [(held * (SUPPLY - held) / (0.5 * SUPPLY) ** 2 - s[0]) / 1e-3, s[0]]

    found = integrate.solve_ivp(
        warm, (0.0, TIME[600]), [0.0, 0.0], t_eval=TIME[:601], max_step=0.5 * STEP
    )
    mean = np.diff(found.y[1]) / STEP
    np.testing.assert_allclose(act(amplifier, drive) - drive, 0.1 * mean, atol=1e-4)
    half = act(amplifier, np.full(20_000, -0.5 * SUPPLY))
    assert half[-1] == pytest.approx(0.1 - 0.5 * SUPPLY)


def test_a_starved_amplifier_charges_by_the_root_of_time() -> None:
    starved = StarvedAmplifier(axis="x", power=80e-6, capacitance=100e-9)
    mean = act(starved, np.full(2000, -3.0))
    root = np.minimum(np.sqrt(1600.0 * STEP * (np.arange(2000) + 0.5)), 3.0)
    np.testing.assert_allclose(mean[10:], -root[10:], rtol=1e-3)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), power=st.floats(1e-6, 1e-2))
def test_what_the_piezo_stores_grows_by_no_more_than_the_power(seed: int, power: float) -> None:
    drive = np.random.default_rng(seed).normal(0.0, 2.0, 100)
    starved = StarvedAmplifier(axis="x", power=power, capacitance=100e-9)
    before = 0.0
    for u in drive:
        after, mean = starved.act(before, np.array([u]), np.zeros(1), STEP)
        gained = 0.5 * 100e-9 * (after**2 - before**2)
        assert gained <= power * STEP * (1.0 + 1e-9)
        assert after * u >= 0.0
        assert abs(after) <= abs(u)
        assert min(abs(before), abs(u)) * (before * u > 0.0) - 1e-12 <= abs(mean[0]) <= abs(u)
        if abs(after) < abs(u) * (1.0 - 1e-9) and before * u >= 0.0:
            assert gained == pytest.approx(power * STEP)
        before = after
