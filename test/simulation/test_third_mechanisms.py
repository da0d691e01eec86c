"""The mechanisms of opened_sizes.py of the third set, each against its equation's solution."""

from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, signal

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.activated_blocks import ActivatedBlocks
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.compressing_amplifier import CompressingAmplifier
from afm_scan_ros.simulation.mechanisms.glitching_converter import GlitchingConverter
from afm_scan_ros.simulation.mechanisms.linear_phase_sensor import LinearPhaseSensor
from afm_scan_ros.simulation.mechanisms.relaxing_clamp import RelaxingClamp
from afm_scan_ros.simulation.mechanisms.ringing_amplifier import RingingAmplifier
from afm_scan_ros.simulation.mechanisms.sliding_sample import SlidingSample
from afm_scan_ros.simulation.mechanisms.stribeck_guide import SPEED, StribeckGuide
from afm_scan_ros.simulation.mechanisms.thumping_compressor import FRAME, ThumpingCompressor
from afm_scan_ros.simulation.mechanisms.uneven_converter import UnevenConverter
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STAGE = Stage(2.0 * np.pi * 454.0, 0.012)
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)
TIME = STEP * np.arange(WAVE.size)


def act(insert: Insert, own: Array, step: float = STEP, seed: int = 0) -> Array:
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own), step)[1]


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


BLOCK = PlayBank(np.array([0.1]), np.array([1.0]), 1.0, 0.0, 0.0)


def lagging(drive: Array, step: float) -> Array:
    """Where one block of threshold 0.1 V is, V, on its way through a drive."""
    blocks = ActivatedBlocks(axis="x", activation=0.01, slip_speed=20.0).bank(BLOCK, step)
    return blocks.apply(blocks.relaxed(), drive)[1] - drive


def test_activated_blocks_follow_their_law() -> None:
    """Against scipy's stiff solver, under a drive that is held."""

    def slip(_: float, position: Array) -> Array:
        return np.asarray(20.0 * np.sinh((0.03 - position) / 0.01))

    fine = np.linspace(0.0, 200 * STEP, 200 * 50 + 1)
    found = integrate.solve_ivp(slip, (0.0, fine[-1]), [0.0], "LSODA", fine, rtol=1e-9, atol=1e-12)
    mean = [integrate.simpson(found.y[0][50 * k : 50 * k + 51]) / 50.0 for k in range(200)]
    np.testing.assert_allclose(lagging(np.full(200, 0.13), STEP), mean, atol=2e-6)


@pytest.mark.parametrize(("speed", "step"), [(1.0, 1e-5), (1e3, 1e-7), (1e4, 1e-7)])
def test_activated_blocks_lag_by_the_logarithm_of_the_speed(speed: float, step: float) -> None:
    drive = np.arange(0.0, 0.5, speed * step)
    lag = drive[-1] - lagging(drive, step)[-1] - 0.1
    assert lag == pytest.approx(0.01 * np.arcsinh(speed / 20.0), rel=0.02)


def test_activated_blocks_are_free_ones_where_they_are_hardly_held(plant: PlantSpec) -> None:
    plays = PlayBank.from_spec(plant.x.hysteresis)
    drive = 3.0 * np.sin(np.arange(4000) * 2.0 * np.pi / 2000)
    blocks = ActivatedBlocks(axis="x", activation=1e-7, slip_speed=1e3).bank(plays, STEP)
    np.testing.assert_allclose(
        blocks.apply(blocks.relaxed(), drive)[1],
        plays.apply(plays.relaxed(), drive)[1],
        atol=5e-3,
    )


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


@settings(deadline=None, max_examples=5)
@given(seed=st.integers(0, 1000))
def test_a_compressor_rings_as_its_frame_and_repeats_with_its_strokes(seed: int) -> None:
    frame, damping = FRAME
    compressor = ThumpingCompressor(axis="x", amplitude=1e-7, strokes=20.0)
    z = act(compressor, np.zeros(40_000), seed=seed)
    np.testing.assert_allclose(z[:30_000], z[10_000:], atol=1e-18)
    speed = np.diff(z) / STEP
    forces = np.diff(speed) / STEP + 2.0 * damping * frame * speed[1:] + frame**2 * z[1:-1]
    knocks = np.flatnonzero(np.abs(forces) > 0.1 * np.abs(forces).max())
    assert len({int(k) // 5 for k in knocks}) <= 2 * 4  # one or two steps of each stroke
    total = forces.sum() * STEP / 4.0
    assert total == pytest.approx(1e-7 * frame * np.sqrt(1.0 - damping**2), rel=2e-2)


@given(st.floats(-5.0, 5.0), st.floats(5.5, 100.0))
def test_an_amplifier_compresses_towards_its_rails(volt: float, rail: float) -> None:
    (out,) = act(CompressingAmplifier(axis="x", rail=rail), np.array([volt]))
    expected = volt - volt**3 / (3.0 * rail**2)
    assert abs(out) <= abs(volt) + 1e-15  # rounding
    assert out == pytest.approx(expected, abs=2.0 / 15.0 * abs(volt) ** 5 / rail**4 + 1e-12)


def bent(guide: StribeckGuide, path: Array) -> tuple[Array, Array]:
    """How far a guide's bristles are bent in the end, and u (m), along a path (m)."""
    attached = guide.attached(STAGE)
    pushed = np.vstack((path, np.zeros(path.size)))
    rest = attached.at_rest(STEP, np.random.default_rng(0))
    (state, _), signals = attached.apply(rest, pushed, STEP)
    return state[2:], signals[0] - path


@pytest.mark.parametrize("speed", [1e-5, 1e-3, 2e-3, 1e-2])
def test_a_greased_guide_holds_as_stribecks_curve_says(speed: float) -> None:
    guide = StribeckGuide(axis="x", share=0.01, reaches=(1e-7,), stiction=1.0)
    (bend,), u = bent(guide, speed * STEP * np.arange(400_000 if speed == 1e-5 else 40_000))
    held = 1e-7 * (1.0 + np.exp(-((speed / SPEED) ** 2)))
    assert bend == pytest.approx(held, rel=1e-2)
    assert u[-1] == pytest.approx(-0.01 * held, rel=2e-2)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), stiction=st.floats(0.0, 3.0))
def test_a_greased_guide_gives_back_no_more_than_it_took(seed: int, stiction: float) -> None:
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, 1e-8, 3000)) + 1e-5 * np.sin(rng.uniform(1, 30) * TIME[:3000])
    guide = StribeckGuide(axis="x", share=0.01, reaches=(3e-7,), stiction=stiction).attached(STAGE)
    state, taken, before, last = guide.at_rest(STEP, rng), 0.0, 0.0, 0.0
    for k in range(path.size):
        state, moved = guide.apply(state, np.array([[path[k]], [0.0]]), STEP)
        bend, x = float(state[0][2]), float(moved[0, 0])
        taken += 0.5 * (bend + before) * (x - last)
        assert taken >= 0.5 * bend**2 * (1.0 - 1e-2) - 1e-18
        before, last = bend, x


def test_an_amplifier_rings_as_its_transfer_function_says() -> None:
    natural = 2.0 * np.pi * 1200.0
    rung = act(RingingAmplifier(axis="x", frequency=1200.0, damping=0.05), np.ones(4000))
    system = signal.lti([natural**2], [1.0, 0.1 * natural, natural**2])
    fine = np.linspace(0.0, 4000 * STEP, 4000 * 10 + 1)
    v = signal.step(system, T=fine)[1]
    mean = [integrate.simpson(v[10 * k : 10 * k + 11]) / 10.0 for k in range(4000)]
    np.testing.assert_allclose(rung, mean, atol=1e-8)


def test_a_bit_that_weighs_too_much_repeats_every_other_weight() -> None:
    x = np.linspace(-10e-6, 10e-6, 20_001)
    error = act(UnevenConverter(axis="x", weight=2e-6, error=1e-7), x) - x
    inside = np.abs(np.mod(x, 2e-6) - 1e-6) > 2e-9  # off the edges, where rounding decides
    set_ = np.mod(x + 1e-6, 4e-6) > 2e-6
    np.testing.assert_allclose(error[inside], np.where(set_, 1e-7, 0.0)[inside], atol=1e-18)


def test_a_sample_slides_on_as_far_as_friction_lets_it() -> None:
    """Stopped from 3 mm/s at once, it slides by v^2 / 2 grip; stopped gently it does not."""
    ramp = np.minimum(3e-3 * TIME, 3e-3 * TIME[1000])
    start = act(SlidingSample(axis="x", grip=2.0, room=1.0), ramp) - ramp
    assert start[999] == pytest.approx(-(3e-3**2) / 4.0, rel=1e-2)
    assert start[-1] == pytest.approx(0.0, abs=3e-8)
    gentle = 1e-6 * (1.0 - np.cos(1e3 * TIME))  # 1 m/s^2 at most
    np.testing.assert_allclose(act(SlidingSample(axis="x", grip=1.02, room=1.0), gentle), gentle)


@settings(deadline=None, max_examples=20)
@given(grip=st.floats(0.01, 10.0), room=st.floats(1e-9, 1e-5))
def test_a_sample_stays_in_its_recess(grip: float, room: float) -> None:
    slid = act(SlidingSample(axis="x", grip=grip, room=room), WAVE) - WAVE
    assert np.abs(slid).max() <= room * (1.0 + 1e-9)


def test_a_converter_glitches_up_whichever_way_it_crosses_zero() -> None:
    drive = np.repeat([1.0, -1.0, -2.0, 1.0, 2.0], 8)
    spikes = act(GlitchingConverter(axis="x", height=0.4, lasting=12e-6), drive) - drive
    assert np.flatnonzero(spikes).tolist() == [8, 9, 10, 24, 25, 26]
    np.testing.assert_allclose(spikes[8:11], [0.4, 0.4, 0.16], atol=1e-12)


def test_without_size_they_leave_everything_as_it_was() -> None:
    for none in (
        RelaxingClamp(axis="x", scale=0.0, settling=1.0),
        ThumpingCompressor(axis="x", amplitude=0.0, strokes=20.0),
        UnevenConverter(axis="x", weight=1e-6, error=0.0),
        GlitchingConverter(axis="x", height=0.0, lasting=1e-5),
        SlidingSample(axis="x", grip=1e9, room=1.0),
    ):
        np.testing.assert_array_equal(act(none, WAVE), WAVE)
    guide = StribeckGuide(axis="x", share=0.0, reaches=(1e-7,), stiction=1.0)
    np.testing.assert_array_equal(bent(guide, WAVE)[1], np.zeros(WAVE.size))
