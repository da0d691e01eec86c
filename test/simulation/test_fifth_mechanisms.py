"""The mechanisms of opened_sizes.py of the fifth set, each against its equation's solution."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms import boiling_cryostat
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.boiling_cryostat import BUBBLES, INSERT, BoilingCryostat
from afm_scan_ros.simulation.mechanisms.bursting_supply import BurstingSupply
from afm_scan_ros.simulation.mechanisms.late_divider import LateDivider
from afm_scan_ros.simulation.mechanisms.pipelined_sensor import LATENCY, PipelinedSensor
from afm_scan_ros.simulation.mechanisms.pressed_balls import PressedBalls
from afm_scan_ros.simulation.mechanisms.regulated_stage import RegulatedStage
from afm_scan_ros.simulation.mechanisms.thinning_blocks import ThinningBlocks
from afm_scan_ros.simulation.mechanisms.worn_bearing import FRAME, PASSES, WornBearing
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STIFF = Stage(1e5, 0.7)  # follows what pulls at it
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)
TIME = STEP * np.arange(WAVE.size)


def act(insert: Insert, own: Array, step: float = STEP, seed: int = 0) -> Array:
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own), step)[1]


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), clock=st.floats(1e-6, 1e-3))
def test_a_pipeline_gives_what_it_took_some_ticks_ago(seed: int, clock: float) -> None:
    """Against its story told tick by tick."""
    gone = np.random.default_rng(seed).uniform()
    ticks = clock * (np.arange(-5, TIME[-1] / clock + 2) - gone)
    taken = np.interp(ticks - LATENCY * clock, TIME, WAVE)  # 0 before it began
    told = taken[np.searchsorted(ticks, TIME, side="right") - 1]
    read = act(PipelinedSensor(axis="x", clock=clock), WAVE, seed=seed)
    same = np.isclose(read, told, rtol=0.0, atol=1e-15)
    assert np.count_nonzero(~same) <= 1  # a tick may fall on an instant, but for its rounding


def test_a_pipeline_is_late_by_its_ticks_and_a_half() -> None:
    clock = 14.3e-6
    late = (TIME - act(PipelinedSensor(axis="x", clock=clock), TIME))[100:]
    assert late.mean() == pytest.approx((LATENCY + 0.5) * clock, rel=1e-2)
    assert late.std() == pytest.approx(clock / np.sqrt(12.0), rel=2e-2)


BLOCK = PlayBank(np.array([0.1]), np.array([1.0]), 1.0, 0.0, 0.0)


def dragged(drive: Array, step: float) -> Array:
    """Where one block of threshold 0.1 V is, V, on its way through a drive."""
    blocks = ThinningBlocks(axis="x", film=1e-6).bank(BLOCK, step)
    return blocks.apply(blocks.relaxed(), drive)[1] - drive


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_thinning_blocks_follow_their_law(sign: float) -> None:
    """Against scipy's solver, under a drive that is held: mean over each step."""
    fine = np.linspace(0.0, 100 * STEP, 100 * 50 + 1)
    found = integrate.solve_ivp(
        lambda _, p: (0.03 - p) ** 2 / 1e-6, (0.0, fine[-1]), [0.0], "LSODA", fine, rtol=1e-9
    )
    mean = [integrate.simpson(found.y[0][50 * k : 50 * k + 51]) / 50.0 for k in range(100)]
    path = sign * dragged(sign * np.full(100, 0.13), STEP)
    np.testing.assert_allclose(path, mean, atol=2e-6)


@settings(deadline=None, max_examples=20)
@given(speed=st.floats(1.0, 1e4))
def test_thinning_blocks_lag_by_the_root_of_the_speed(speed: float) -> None:
    step = 2e-4 * np.sqrt(1e-6 / speed)
    drive = speed * step * np.arange(40_000) + 0.1
    lag = drive[-1] - dragged(drive, step)[-1] - 0.1
    assert lag == pytest.approx(np.sqrt(1e-6 * speed), rel=1e-3)


def test_a_regulator_swings_as_its_loop_does() -> None:
    """Against the loop itself: a proportional part, and one that adds up what is missing."""
    stage = RegulatedStage(axis="x", growth=1e-6, period=12.0, damping=0.3)
    natural, time = 2.0 * np.pi / 12.0, 5e-3 * np.arange(8000)
    found = integrate.solve_ivp(
        lambda _, s: [0.6 * natural * (1.0 - s[0]) + natural**2 * s[1], 1.0 - s[0]],
        (0.0, time[-1]),
        [0.0, 0.0],
        "DOP853",
        time,
        rtol=1e-9,
        atol=1e-12,
    )
    moved = act(stage, np.zeros(time.size), step=5e-3)
    np.testing.assert_allclose(moved, 1e-6 * found.y[0], atol=1e-14)
    assert moved.max() > 1.4e-6


@pytest.mark.parametrize("seed", range(3))
def test_a_worn_bearing_has_the_lines_of_shaft_and_balls_alone(seed: int) -> None:
    """Each as high as a force of its share, a comb for the knocks, moves the frame."""
    shaft, count = 25.0, 20_000
    assert round(PASSES * shaft) == pytest.approx(73.0)
    shaken = act(
        WornBearing(axis="x", amplitude=1.0, shaft=shaft), np.zeros(count), 1 / count, seed
    )
    lines = np.abs(np.fft.rfft(shaken)) * 2.0 / count  # 1 Hz apart
    natural, damping = FRAME

    def frame(hertz: Array) -> Array:
        s = 2j * np.pi * hertz
        return np.abs(natural**2 / (s**2 + 2.0 * damping * natural * s + natural**2))

    balls = 73 * np.arange(1, 20)
    assert lines[25] == pytest.approx(frame(np.array(25.0)), rel=1e-3)
    np.testing.assert_allclose(lines[balls], 2.0 * 73.0 / natural * frame(balls), rtol=2e-2)
    lines[[0, 25, *balls]] = 0.0
    assert lines[:1400].max() < 2e-4


def rubbed(push: Array) -> Array:
    """What balls of a reach of 10 um hold, in units of that and of their share."""
    balls = PressedBalls(axis="x", share=1e-3, reach=10e-6).attached(STIFF)
    both = np.vstack((10e-6 * push, np.zeros(push.size)))
    moved = balls.apply(balls.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]
    return (10e-6 * push - moved) / 10e-9


def mindlin(x: Array) -> Array:
    return 2.0 / 3.0 * (1.0 - np.maximum(1.0 - x, 0.0) ** 1.5)


def test_balls_hold_as_mindlins_contact_does_forth_and_back() -> None:
    there = np.linspace(0.0, 0.8, 20_001)
    held = rubbed(np.concatenate((there, there[::-1])))
    np.testing.assert_allclose(held[:20_001], mindlin(there), atol=2e-3)
    back = mindlin(np.array(0.8)) - 2.0 * mindlin(0.5 * there)
    np.testing.assert_allclose(held[20_001:], back, atol=2e-3)
    assert rubbed(np.linspace(0.0, 2.0, 20_001))[-1] == pytest.approx(2.0 / 3.0, rel=2e-3)


@pytest.mark.parametrize("amplitude", [0.2, 0.4, 0.8])
def test_balls_lose_in_a_loop_what_masings_rule_says(amplitude: float) -> None:
    """Eight times what their law takes on the way there beyond what a spring would."""
    push = amplitude * np.sin(4.0 * np.pi * np.arange(160_001) / 160_000)
    lost = integrate.trapezoid(rubbed(push)[80_000:], push[80_000:])
    there = np.linspace(0.0, amplitude, 10_001)
    taken = integrate.trapezoid(mindlin(there), there)
    expected = 8.0 * (taken - 0.5 * amplitude * mindlin(there)[-1])
    assert lost == pytest.approx(expected, rel=4e-2)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), sag=st.floats(1e-3, 1.0))
def test_an_excitation_sags_between_bursts_about_the_same_mean(seed: int, sag: float) -> None:
    supply, count = BurstingSupply(axis="x", sag=sag, bursts=100.0), 10_000
    gain = act(supply, np.ones(5 * count), 0.01 / count, seed)
    assert gain.mean() == pytest.approx(1.0, abs=sag / count)
    steps = np.diff(np.log(gain))
    bursts = np.flatnonzero(steps > 0.0)
    np.testing.assert_array_equal(np.diff(bursts), count)
    np.testing.assert_allclose(steps[bursts], sag * (1.0 - 1.0 / count), rtol=1e-6)
    np.testing.assert_allclose(np.delete(steps, bursts), -sag / count, rtol=1e-6)
    assert not act(supply, np.zeros(10)).any()


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


def test_bubbles_ring_the_insert_one_by_one() -> None:
    """Against the sum over all of them."""
    cryostat, time = BoilingCryostat(axis="x", amplitude=2e-9), 1e-4 * np.arange(5000)
    knocks, rings = cryostat.drawn(np.random.default_rng(0))
    natural, damping = INSERT
    root = np.sqrt(1.0 - damping**2)
    pole = natural * (1j * root - damping)
    hard = rings[1:300] - rings[:299] * np.exp(pole * np.diff(knocks[:300]))
    np.testing.assert_allclose(hard.imag, 0.0, atol=1e-12)
    since = np.maximum(time[:, None] - knocks[1:300], 0.0)
    told = np.exp(-damping * natural * since) * np.sin(natural * root * since) @ hard.real / root
    np.testing.assert_allclose(act(cryostat, np.zeros(5000), 1e-4), 2e-9 * told, atol=1e-18)


def test_bubbles_ring_as_campbells_theorem_says() -> None:
    natural, damping = INSERT
    rung = act(BoilingCryostat(axis="x", amplitude=1.0), np.zeros(1_000_000), 5e-4)
    assert rung.mean() == pytest.approx(BUBBLES / natural, rel=0.1)
    assert rung.var() == pytest.approx(BUBBLES * 2.0 / (4.0 * damping * natural), rel=0.1)


def test_a_cryostat_that_has_boiled_away_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(boiling_cryostat, "KNOCKS", 100)
    with pytest.raises(InputError, match="outlasts 100 bubbles"):
        act(BoilingCryostat(axis="x", amplitude=1e-9), np.zeros(1000), 1e-2)


def test_without_size_they_leave_everything_as_it_was(plant: PlantSpec) -> None:
    for none in (
        PipelinedSensor(axis="x", clock=1e-15),
        RegulatedStage(axis="x", growth=0.0, period=1.0, damping=0.5),
        WornBearing(axis="x", amplitude=0.0, shaft=20.0),
        BurstingSupply(axis="x", sag=1e-15, bursts=100.0),
        LateDivider(axis="x", reach=1e3, settling=1e-3),
        BoilingCryostat(axis="x", amplitude=0.0),
    ):
        np.testing.assert_allclose(act(none, WAVE), WAVE, atol=1e-15)
    drive, plays = 1e5 * WAVE, PlayBank.from_spec(plant.x.hysteresis)
    free = ThinningBlocks(axis="x", film=1e-20).bank(plays, STEP)
    followed = plays.apply(plays.relaxed(), drive)[1]
    np.testing.assert_allclose(free.apply(free.relaxed(), drive)[1], followed, atol=1e-9)
    idle = PressedBalls(axis="x", share=0.0, reach=1e-5).attached(STIFF)
    both = np.vstack((WAVE, np.zeros(WAVE.size)))
    kept = idle.apply(idle.at_rest(STEP, np.random.default_rng(0)), both, STEP)[1][0]
    np.testing.assert_array_equal(kept, WAVE)
