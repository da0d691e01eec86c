"""Mechanisms of sensor_dynamics.py, each against the solution of its equation."""

from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, signal

from afm_scan_bench.mechanisms.sensor_dynamics import (
    HALF_PERIOD,
    PIPELINE_LATENCY,
    AveragingSensor,
    HumEliminator,
    LateDivider,
    LinearPhaseSensor,
    PipelinedSensor,
)
from afm_scan_ros.core.types import Array
from helpers.acting import STEP, TIME, WAVE, act


@pytest.mark.parametrize("window", [1e-6, 92e-6, 300e-6])
def test_an_averaged_ramp_is_half_a_window_late(window: float) -> None:
    ramp = 1e-3 * STEP * np.arange(1000)
    read = act(AveragingSensor(axis="x", window=window), ramp)
    late = 1e-3 * (STEP * np.arange(1000) - window / 2.0)
    np.testing.assert_allclose(read[200:], late[200:], atol=1e-15)


def test_a_bessel_filter_follows_its_transfer_function_and_is_late_by_its_delay() -> None:
    delay, sensor = 200e-6, LinearPhaseSensor(axis="x", delay=200e-6)
    bessel = [
        factorial(8 - n) // factorial(4 - n) // 2 ** (4 - n) // factorial(n) for n in range(5)
    ]
    rising = [c * delay**n for n, c in enumerate(bessel)]
    system = signal.lti([105.0], rising[::-1])
    np.testing.assert_allclose(act(sensor, WAVE), signal.lsim(system, WAVE, TIME)[1], atol=1e-14)
    ramp = act(sensor, TIME)
    np.testing.assert_allclose(ramp[1000:], TIME[1000:] - delay, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), clock=st.floats(1e-6, 1e-3))
def test_a_pipeline_gives_what_it_took_some_ticks_ago(seed: int, clock: float) -> None:
    """Against a simulation tick by tick."""
    gone = np.random.default_rng(seed).uniform()
    ticks = clock * (np.arange(-5, TIME[-1] / clock + 2) - gone)
    taken = np.interp(ticks - PIPELINE_LATENCY * clock, TIME, WAVE)  # 0 before it began
    simulated = taken[np.searchsorted(ticks, TIME, side="right") - 1]
    read = act(PipelinedSensor(axis="x", clock=clock), WAVE, seed=seed)
    same = np.isclose(read, simulated, rtol=0.0, atol=1e-15)
    assert np.count_nonzero(~same) <= 1  # a tick may fall on an instant, but for its rounding


def test_a_pipeline_is_late_by_its_ticks_and_a_half() -> None:
    clock = 14.3e-6
    late = (TIME - act(PipelinedSensor(axis="x", clock=clock), TIME))[100:]
    assert late.mean() == pytest.approx((PIPELINE_LATENCY + 0.5) * clock, rel=1e-2)
    assert late.std() == pytest.approx(clock / np.sqrt(12.0), rel=2e-2)


def test_a_divider_takes_the_light_of_a_moment_ago() -> None:
    divider = LateDivider(axis="x", reach=30e-6, settling=1e-3)

    def follow(t: float, w: Array) -> Array:
        return np.asarray((np.interp(t, TIME, (WAVE / 30e-6) ** 2) - w) / 1e-3)

    found = integrate.solve_ivp(
        follow, (0.0, TIME[-1]), [0.0], "DOP853", TIME, max_step=STEP, rtol=1e-9, atol=1e-12
    )
    expected = WAVE * (1.0 - (WAVE / 30e-6) ** 2) / (1.0 - found.y[0])
    np.testing.assert_allclose(act(divider, WAVE), expected, atol=1e-13)


@settings(deadline=None, max_examples=20)
@given(level=st.floats(-29e-6, 29e-6))
def test_a_divider_reads_a_level_rightly_at_last(level: float) -> None:
    read = act(LateDivider(axis="x", reach=30e-6, settling=1e-4), np.full(1000, level))
    assert read[-1] == pytest.approx(level, rel=1e-9)
    assert abs(read[0]) <= abs(level)


@pytest.mark.parametrize("step", [5e-6, 4.7619e-6])
def test_a_box_takes_away_what_turns_its_sign_with_the_mains(step: float) -> None:
    """Against a simulation echo by echo."""
    time = step * np.arange(14_000)
    signal = 1e-6 * np.sin(2.0 * np.pi * 30.0 * time) * np.sin(13.0 * time)
    read = act(HumEliminator(axis="x", learning=0.2), signal, step=step)
    simulated = signal.copy()
    for echo in range(1, 8):
        late = np.interp(time - echo * HALF_PERIOD, time, signal, left=0.0)
        simulated += 0.2 * 0.8 ** (echo - 1) * (-1.0) ** (echo + 1) * late
    np.testing.assert_allclose(read, simulated, atol=1e-5 * 1e-6)


def test_a_box_forgets_nothing_of_the_hum_but_its_share() -> None:
    time = STEP * np.arange(20_000)
    hum = np.sin(2.0 * np.pi * 50.0 * time) + 0.3 * np.sin(2.0 * np.pi * 150.0 * time)
    read = act(HumEliminator(axis="x", learning=0.2), hum)
    left = 0.8 ** np.floor((np.arange(20_000) + 0.5) / 2000.0)
    np.testing.assert_allclose(read, left * hum, atol=1e-9)
