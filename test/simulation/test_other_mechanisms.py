"""The mechanisms of other_sizes.py, each against the solution of its equation."""

import numpy as np
import pytest
from scipy import integrate, linalg, signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.averaging_sensor import AveragingSensor
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.buffered_amplifier import BufferedAmplifier
from afm_scan_ros.simulation.mechanisms.fading_gain import FadingGain
from afm_scan_ros.simulation.mechanisms.hardened_domains import HardenedDomains
from afm_scan_ros.simulation.mechanisms.hastened_blocks import HastenedBlocks
from afm_scan_ros.simulation.mechanisms.heated_rod import HeatedRod
from afm_scan_ros.simulation.mechanisms.polymer_pad import PolymerPad
from afm_scan_ros.simulation.mechanisms.popping_mount import PoppingMount
from afm_scan_ros.simulation.mechanisms.rubbing_guide import RubbingGuide
from afm_scan_ros.simulation.mechanisms.saturating_sensor import SaturatingSensor
from afm_scan_ros.simulation.mechanisms.shared_ground import SharedGround
from afm_scan_ros.simulation.mechanisms.springy_joint import SpringyJoint
from afm_scan_ros.simulation.mechanisms.sprung_holder import SprungHolder
from afm_scan_ros.simulation.mechanisms.supply_ripple import SupplyRipple
from afm_scan_ros.simulation.mechanisms.swinging_arm import SwingingArm
from afm_scan_ros.simulation.mechanisms.tired_amplifier import TiredAmplifier
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STAGE = Stage(2.0 * np.pi * 454.0, 0.012)
RNG = np.random.default_rng(0)
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)


def act(insert: Insert, own: Array, other: Array | None = None, step: float = STEP) -> Array:
    state = insert.at_rest(step, np.random.default_rng(0))
    return insert.act(state, own, np.zeros_like(own) if other is None else other, step)[1]


@pytest.mark.parametrize("window", [1e-6, 92e-6, 300e-6])
def test_an_averaged_ramp_is_half_a_window_late(window: float) -> None:
    ramp = 1e-3 * STEP * np.arange(1000)
    read = act(AveragingSensor(axis="x", window=window), ramp)
    late = 1e-3 * (STEP * np.arange(1000) - window / 2.0)
    np.testing.assert_allclose(read[200:], late[200:], atol=1e-15)


def test_heat_diffuses_into_the_rod() -> None:
    """Against the heat equation, by lines on 200 cells and scipy's stiff solver."""
    rod, cells = HeatedRod(axis="x", growth=1e-6, diffusion_time=2.0), 200

    def flow(_: float, warm: Array) -> Array:
        below = np.concatenate(([2.0 - warm[0]], warm[:-1]))  # the first cell's edge is held at 1
        above = np.concatenate((warm[1:], warm[-1:]))
        return np.asarray((below - 2.0 * warm + above) * cells**2 / 2.0)

    times = np.array([0.1, 0.5, 2.0])
    found = integrate.solve_ivp(flow, (0.0, 2.0), np.zeros(cells), "LSODA", times, rtol=1e-8)
    grown = act(rod, np.zeros(201), step=0.01)
    expected = 1e-6 * found.y.mean(axis=0)
    np.testing.assert_allclose(grown[(times / 0.01).astype(int)], expected, rtol=1e-3)


def test_a_gauge_flattens_about_its_middle() -> None:
    gauge = SaturatingSensor(axis="x", reach=50e-6, offset=5e-6)
    x = np.linspace(-20e-6, 30e-6, 1001)
    read = act(gauge, x)
    slope = np.gradient(read, x)
    assert x[slope.argmax()] == pytest.approx(5e-6, abs=1e-7)
    assert np.interp(0.0, x, read) == pytest.approx(0.0, abs=1e-12)
    assert np.interp(0.0, x, slope) == pytest.approx(1.0, rel=1e-4)
    np.testing.assert_allclose(slope, 1.01 / (1.0 + ((x - 5e-6) / 50e-6) ** 2), rtol=1e-3)


def test_bristles_are_a_spring_until_they_slip() -> None:
    stiff = RubbingGuide(axis="x", share=0.1, reaches=(1.0,)).attached(STAGE)
    slipping = RubbingGuide(axis="x", share=0.1, reaches=(1e-7,)).attached(STAGE)
    ramp = np.concatenate((np.linspace(0.0, 10e-6, 200_000), np.full(200_000, 10e-6)))
    pushed = np.vstack((ramp, np.zeros(ramp.size)))
    _, held = stiff.apply(stiff.at_rest(STEP, RNG), pushed, STEP)
    _, moved = slipping.apply(slipping.at_rest(STEP, RNG), pushed, STEP)
    assert held[0, -1] == pytest.approx(10e-6 / 1.1, rel=1e-6)
    assert moved[0, 199_000] == pytest.approx(ramp[199_000] - 0.1 * 1e-7, abs=1e-9)


def test_a_ripple_has_the_harmonics_of_a_rectified_sine() -> None:
    ripple = act(SupplyRipple(axis="x", amplitude=0.1, frequency=100.0), np.zeros(40_000))
    lines = np.abs(np.fft.rfft(ripple)) / 20_000
    order = np.array([1, 2, 3])
    expected = 0.4 / np.pi / (4.0 * order**2 - 1.0)  # the Fourier series of |sin|
    np.testing.assert_allclose(lines[20 * order], expected, rtol=1e-4)
    assert lines[0] == pytest.approx(0.0, abs=1e-6)


def test_hastened_blocks_are_free_ones_when_slow_and_lag_when_fast(plant: PlantSpec) -> None:
    plays = PlayBank.from_spec(plant.x.hysteresis)
    widths = []
    for count in (500_000, 5_000, 500):
        drive = 3.0 * np.sin(2.0 * np.pi * np.arange(2 * count) / count)
        hard = HastenedBlocks(axis="x", hardening=2e-4).bank(plays, STEP)
        _, path = hard.apply(hard.relaxed(), drive)
        _, free = plays.apply(plays.relaxed(), drive)
        widths.append(float(np.abs(path - free)[count:].max()))
    assert widths[0] < 0.01 < widths[1] < widths[2]


def test_two_stages_charge_as_their_matrix_says() -> None:
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


def test_a_holder_swings_as_its_transfer_function_says() -> None:
    natural, holder = 2.0 * np.pi * 900.0, SprungHolder(axis="x", frequency=900.0, damping=0.02)
    loss = 2.0 * 0.02 * natural
    system = signal.lti([loss, natural**2], [1.0, loss, natural**2])
    _, expected, _ = signal.lsim(system, WAVE, STEP * np.arange(WAVE.size))
    np.testing.assert_allclose(act(holder, WAVE), expected, atol=2e-12)


def test_a_ground_carries_a_share_of_the_other_axis() -> None:
    ground = SharedGround(axis="x", share=0.01, time_constant=50e-6)
    picked = act(ground, np.zeros(40), np.ones(40))
    expected = -0.01 * np.expm1(-STEP * np.arange(1, 41) / 50e-6)
    np.testing.assert_allclose(picked, expected, rtol=1e-9)


def test_a_pad_creeps_by_a_power_of_time() -> None:
    crept = act(PolymerPad(axis="x", share=0.05, power=0.25), np.ones(20_000), step=1e-3) - 1.0
    time = 1e-3 * np.arange(1, 20_001)
    ratio = crept / (0.05 * time**0.25)
    assert ratio[999] == pytest.approx(1.0, rel=0.02)
    slope = np.polyfit(np.log(time[50:]), np.log(crept[50:]), 1)[0]
    assert slope == pytest.approx(0.25, abs=0.04)


def test_a_tired_amplifier_follows_its_equation() -> None:
    amplifier = TiredAmplifier(axis="x", current=1e-3, resistance=300.0, capacitance=100e-9)

    def charge(_: float, v: Array) -> Array:
        return np.asarray(1e-3 * np.tanh((1.0 - v) / 0.3) / 100e-9)

    ends = STEP * np.arange(61)
    found = integrate.solve_ivp(charge, (0.0, ends[-1]), [0.0], "LSODA", ends, rtol=1e-9, atol=1e-9)
    v = found.y[0]
    np.testing.assert_allclose(act(amplifier, np.ones(60)), 0.5 * (v[1:] + v[:-1]), atol=1e-6)


def test_pinned_domains_widen_the_loop(plant: PlantSpec) -> None:
    drive = 3.0 * np.sin(np.arange(2000) * 2.0 * np.pi / 1000)
    loops = []
    for factor in (0.0, 1.0, 1.5):
        axis = HardenedDomains(axis="x", factor=factor).altered(plant.x)
        plays = PlayBank.from_spec(axis.hysteresis)
        path = plays.apply(plays.relaxed(), drive)[1][1000:]
        loops.append(abs(path[0] - path[500]))
    assert loops[0] == pytest.approx(0.0, abs=1e-9)
    assert loops[1] < loops[2]


def test_a_spring_passes_its_share_within_the_play() -> None:
    joint = SpringyJoint(axis="x", gap=100e-9, share=0.2)
    moved = act(joint, np.array([50e-9, 300e-9, 200e-9]))
    np.testing.assert_allclose(moved, [10e-9, 220e-9, 200e-9], atol=1e-18)


def test_what_acts_at_once_acts_as_its_formula() -> None:
    time = STEP * np.arange(WAVE.size)
    gain = 1.0 - 0.1 * -np.expm1(-time / 0.01)
    np.testing.assert_allclose(
        act(FadingGain(axis="x", loss=0.1, settling=0.01), WAVE), WAVE * gain
    )
    bent = act(SwingingArm(axis="x", radius=1e-3), WAVE, 2.0 * WAVE)
    np.testing.assert_allclose(bent, WAVE + (2.0 * WAVE) ** 2 / 2e-3)


def test_a_mount_pops_as_often_as_it_should() -> None:
    popped = act(PoppingMount(axis="x", jump=1e-7, dwell=1e-3), np.zeros(400_000))
    assert set(np.unique(popped)) == {0.0, 1e-7}
    jumps = np.count_nonzero(np.diff(popped))
    assert jumps == pytest.approx(2000, rel=5.0 / np.sqrt(2000))  # five standard deviations


def test_a_mount_that_has_popped_all_it_will_is_refused() -> None:
    with pytest.raises(InputError, match="outlasts 100000 pops: make dwell_s longer"):
        act(PoppingMount(axis="x", jump=1e-7, dwell=1e-6), np.zeros(40_000))
