"""Mechanisms of disturbance.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_bench.mechanisms import disturbance
from afm_scan_bench.mechanisms.disturbance import (
    BEARING_FRAME,
    BUBBLES,
    COMPRESSOR_FRAME,
    CRYOSTAT_INSERT,
    PASSES,
    VALVE_PERIOD,
    VALVE_STIFFNESS,
    BoilingCryostat,
    ChatteringValve,
    PoppingMount,
    SupplyRipple,
    ThumpingCompressor,
    WornBearing,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from helpers.acting import STEP, act


def test_a_ripple_has_the_harmonics_of_a_rectified_sine() -> None:
    ripple = act(SupplyRipple(axis="x", amplitude=0.1, frequency=100.0), np.zeros(40_000))
    lines = np.abs(np.fft.rfft(ripple)) / 20_000
    order = np.array([1, 2, 3])
    expected = 0.4 / np.pi / (4.0 * order**2 - 1.0)  # the Fourier series of |sin|
    np.testing.assert_allclose(lines[20 * order], expected, rtol=1e-4)
    assert lines[0] == pytest.approx(0.0, abs=1e-6)


def test_a_mount_pops_as_often_as_it_should() -> None:
    popped = act(PoppingMount(axis="x", jump=1e-7, dwell=1e-3), np.zeros(400_000))
    assert set(np.unique(popped)) == {0.0, 1e-7}
    jumps = np.count_nonzero(np.diff(popped))
    assert jumps == pytest.approx(2000, rel=5.0 / np.sqrt(2000))  # five standard deviations


def test_a_mount_that_has_popped_all_it_will_is_refused() -> None:
    with pytest.raises(InputError, match="outlasts 100000 pops: make dwell_s longer"):
        act(PoppingMount(axis="x", jump=1e-7, dwell=1e-6), np.zeros(40_000))


@settings(deadline=None, max_examples=5)
@given(seed=st.integers(0, 1000))
def test_a_compressor_rings_as_its_frame_and_repeats_with_its_strokes(seed: int) -> None:
    frame, damping = COMPRESSOR_FRAME
    compressor = ThumpingCompressor(axis="x", amplitude=1e-7, strokes=20.0)
    z = act(compressor, np.zeros(40_000), seed=seed)
    np.testing.assert_allclose(z[:30_000], z[10_000:], atol=1e-18)
    speed = np.diff(z) / STEP
    forces = np.diff(speed) / STEP + 2.0 * damping * frame * speed[1:] + frame**2 * z[1:-1]
    knocks = np.flatnonzero(np.abs(forces) > 0.1 * np.abs(forces).max())
    assert len({int(k) // 5 for k in knocks}) <= 2 * 4  # one or two steps of each stroke
    total = forces.sum() * STEP / 4.0
    assert total == pytest.approx(1e-7 * frame * np.sqrt(1.0 - damping**2), rel=2e-2)


@pytest.mark.parametrize("seed", range(3))
def test_a_worn_bearing_has_the_lines_of_shaft_and_balls_alone(seed: int) -> None:
    """Each as high as a force of its share, a comb for the knocks, moves the frame."""
    shaft, count = 25.0, 20_000
    assert round(PASSES * shaft) == pytest.approx(73.0)
    shaken = act(
        WornBearing(axis="x", amplitude=1.0, shaft=shaft),
        np.zeros(count),
        step=1 / count,
        seed=seed,
    )
    lines = np.abs(np.fft.rfft(shaken)) * 2.0 / count  # 1 Hz apart
    natural, damping = BEARING_FRAME

    def frame(hertz: Array) -> Array:
        s = 2j * np.pi * hertz
        return np.abs(natural**2 / (s**2 + 2.0 * damping * natural * s + natural**2))

    balls = 73 * np.arange(1, 20)
    assert lines[25] == pytest.approx(frame(np.array(25.0)), rel=1e-3)
    np.testing.assert_allclose(lines[balls], 2.0 * 73.0 / natural * frame(balls), rtol=2e-2)
    lines[[0, 25, *balls]] = 0.0
    assert lines[:1400].max() < 2e-4


def test_bubbles_ring_the_insert_one_by_one() -> None:
    """Against the sum over all of them."""
    cryostat, time = BoilingCryostat(axis="x", amplitude=2e-9), 1e-4 * np.arange(5000)
    knocks, rings = cryostat.drawn(np.random.default_rng(0))
    natural, damping = CRYOSTAT_INSERT
    root = np.sqrt(1.0 - damping**2)
    pole = natural * (1j * root - damping)
    hard = rings[1:300] - rings[:299] * np.exp(pole * np.diff(knocks[:300]))
    np.testing.assert_allclose(hard.imag, 0.0, atol=1e-12)
    since = np.maximum(time[:, None] - knocks[1:300], 0.0)
    simulated = (
        np.exp(-damping * natural * since) * np.sin(natural * root * since) @ hard.real / root
    )
    np.testing.assert_allclose(
        act(cryostat, np.zeros(5000), step=1e-4), 2e-9 * simulated, atol=1e-18
    )


def test_bubbles_ring_by_campbells_theorem() -> None:
    natural, damping = CRYOSTAT_INSERT
    rung = act(BoilingCryostat(axis="x", amplitude=1.0), np.zeros(1_000_000), step=5e-4)
    assert rung.mean() == pytest.approx(BUBBLES / natural, rel=0.1)
    assert rung.var() == pytest.approx(BUBBLES * 2.0 / (4.0 * damping * natural), rel=0.1)


def test_a_cryostat_that_has_boiled_away_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disturbance, "BUBBLE_COUNT", 100)
    with pytest.raises(InputError, match="outlasts 100 bubbles"):
        act(BoilingCryostat(axis="x", amplitude=1e-9), np.zeros(1000), step=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_a_valve_goes_round_by_van_der_pol(seed: int) -> None:
    time = np.arange(20_000) * 2e-5
    chatter = act(
        ChatteringValve(axis="x", amplitude=1.0, frequency=37.0), 0.0 * time, seed=seed, step=2e-5
    )
    up = np.flatnonzero((chatter[:-1] < 0.0) & (chatter[1:] >= 0.0))
    crossed = time[up] - 2e-5 * chatter[up] / (chatter[up + 1] - chatter[up])
    np.testing.assert_allclose(np.diff(crossed) * 37.0, 1.0, rtol=1e-5)
    found = integrate.solve_ivp(
        lambda _, s: [s[1], VALVE_STIFFNESS * (1.0 - s[0] ** 2) * s[1] - s[0]],
        (0.0, 5.0 * VALVE_PERIOD),
        [2.0, 0.0],
        rtol=1e-9,
        atol=1e-9,
        max_step=0.01,
    )
    cycle = found.y[0][found.t > 3.0 * VALVE_PERIOD]
    assert np.abs(chatter).max() == pytest.approx(np.abs(cycle).max(), rel=1e-4)
