"""Each mechanism against the solution of its equation by other means."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg, optimize

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation import chain
from afm_scan_ros.simulation.creep import series
from afm_scan_ros.simulation.dynamics import Dynamics, first_resonance
from afm_scan_ros.simulation.mechanisms.aged_creep import AgedCreep
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.base import Insert, Mechanism
from afm_scan_ros.simulation.mechanisms.coupled_stage import CoupledStage
from afm_scan_ros.simulation.mechanisms.creeping_mount import CreepingMount
from afm_scan_ros.simulation.mechanisms.cyclic_encoder import CyclicEncoder
from afm_scan_ros.simulation.mechanisms.delayed_converter import DelayedConverter
from afm_scan_ros.simulation.mechanisms.floor_vibration import FloorVibration
from afm_scan_ros.simulation.mechanisms.heavier_load import HeavierLoad
from afm_scan_ros.simulation.mechanisms.lagging_amplifier import LaggingAmplifier
from afm_scan_ros.simulation.mechanisms.limited_amplifier import LimitedAmplifier
from afm_scan_ros.simulation.mechanisms.loose_joint import LooseJoint
from afm_scan_ros.simulation.mechanisms.lost_poling import LostPoling
from afm_scan_ros.simulation.mechanisms.riding_mass import RidingMass
from afm_scan_ros.simulation.mechanisms.scanner_bow import ScannerBow
from afm_scan_ros.simulation.mechanisms.sizes import EFFECTS, sized
from afm_scan_ros.simulation.mechanisms.sprung_body import SprungBody
from afm_scan_ros.simulation.mechanisms.stiffening_flexure import StiffeningFlexure
from afm_scan_ros.simulation.mechanisms.tilted_plate import TiltedPlate
from afm_scan_ros.simulation.mechanisms.tilted_sensor import TiltedSensor
from afm_scan_ros.simulation.mechanisms.viscous_blocks import ViscousBlocks
from afm_scan_ros.simulation.mechanisms.warming_frame import WarmingFrame
from afm_scan_ros.simulation.mechanisms.yielding_tube import YieldingTube
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.scanner import Piezoscanner
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STAGE = Stage(2.0 * np.pi * 454.0, 0.012)
RNG = np.random.default_rng(0)
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)


def act(insert: Insert, own: Array, other: Array | None = None, seed: int = 0) -> Array:
    state = insert.at_rest(STEP, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own) if other is None else other, STEP)[1]


def true_x(plant: PlantSpec, *mechanisms: Mechanism, drive: Array) -> Array:
    scanner = Piezoscanner(evolve(plant, mechanisms=mechanisms), 4e-5, seed=0)
    return scanner.advance(Trace(0, 4e-5, drive, 0.5 * drive))[1].x


DRIVE = 2.0 * np.sin(np.arange(2000) * 0.02) * np.minimum(1.0, np.arange(2000) / 300.0)


@pytest.mark.parametrize("effect", EFFECTS)
def test_the_step_of_integration_does_not_matter(
    plant: PlantSpec, effect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    healthy, coarse = (true_x(plant, *m, drive=DRIVE) for m in ((), sized(effect, "large", "x")))
    monkeypatch.setattr(chain, "STEP", 1e-6)
    fine = true_x(plant, *sized(effect, "large", "x"), drive=DRIVE)
    assert np.std(fine - coarse) < 0.002 * np.std(fine - healthy)


@settings(deadline=None, max_examples=20)
@given(samples=st.integers(0, 12))
def test_a_delay_of_whole_samples_shifts(plant: PlantSpec, samples: int) -> None:
    late = true_x(plant, DelayedConverter(axis="x", delay=samples * 4e-5), drive=DRIVE)
    punctual = true_x(plant, drive=DRIVE)
    np.testing.assert_allclose(late[samples:], punctual[: late.size - samples], atol=1e-14)
    assert not late[: samples + 1].any()


@settings(deadline=None)
@given(delay=st.floats(0.0, 1e-4))
def test_a_delay_keeps_the_area(delay: float) -> None:
    pulse = np.zeros(60)
    pulse[3:9] = 1.0
    leaving = act(DelayedConverter(axis="x", delay=delay), pulse)
    assert leaving.sum() == pytest.approx(6.0)
    centre = np.arange(60) @ leaving / 6.0
    assert centre == pytest.approx(5.5 + delay / STEP)


def test_an_amplifier_charges_as_an_exponential() -> None:
    constant = 40e-6
    mean = act(LaggingAmplifier(axis="x", resistance=400.0, capacitance=100e-9), np.ones(100))
    edges = np.exp(-STEP / constant * np.arange(101))
    np.testing.assert_allclose(mean, 1.0 + np.diff(edges) * constant / STEP, rtol=1e-9)


def test_an_amplifier_with_current_enough_is_not_limited() -> None:
    drive = np.sin(np.arange(300.0))
    parts = {"resistance": 400.0, "capacitance": 100e-9}
    free = act(LaggingAmplifier(axis="x", **parts), drive)
    limited = act(LimitedAmplifier(axis="x", current=1.0, **parts), drive)
    np.testing.assert_allclose(limited, free, atol=1e-12)


def test_a_limited_amplifier_runs_straight_to_within_its_resistance() -> None:
    amplifier = LimitedAmplifier(axis="x", current=50e-6, resistance=400.0, capacitance=100e-9)
    drive = np.full(1000, 1.0)
    fine = 1e-9 * np.arange(int(1000 * STEP / 1e-9))
    meets = (1.0 - 50e-6 * 400.0) / 500.0
    expected = np.where(fine < meets, 500.0 * fine, 1.0 - 0.02 * np.exp(-(fine - meets) / 4e-5))
    mean = expected.reshape(1000, -1).mean(axis=1)
    np.testing.assert_allclose(act(amplifier, drive), mean, atol=1e-6)


def test_thin_films_drag_no_blocks(plant: PlantSpec) -> None:
    plays = PlayBank.from_spec(plant.x.hysteresis)
    drive = 3.0 * np.sin(np.arange(2000) * 0.01)
    thin = ViscousBlocks(axis="x", time_constant=1e-9).bank(plays, STEP)
    _, free = plays.apply(plays.relaxed(), drive)
    np.testing.assert_allclose(thin.apply(thin.relaxed(), drive)[1], free, atol=1e-3)


def test_blocks_catch_up_once_the_drive_holds(plant: PlantSpec) -> None:
    plays = PlayBank.from_spec(plant.x.hysteresis)
    drive = np.concatenate((np.linspace(0.0, 3.0, 100), np.full(2000, 3.0)))
    film = ViscousBlocks(axis="x", time_constant=2e-4).bank(plays, STEP)
    _, free = plays.apply(plays.relaxed(), drive)
    _, dragged = film.apply(film.relaxed(), drive)
    assert free[99] - dragged[99] > 0.5
    assert dragged[-1] == pytest.approx(free[-1], abs=1e-9)


def test_a_mount_creeps_by_its_elements() -> None:
    mount = CreepingMount(axis="x", share=0.1, taus=(1e-3, 1e-2))
    crept = act(mount, np.full(4000, 1e-6))
    time = STEP * np.arange(4000)
    expected = 1e-6 * (1.2 - 0.1 * np.exp(-time / 1e-3) - 0.1 * np.exp(-time / 1e-2))
    np.testing.assert_allclose(crept, expected, atol=1e-9)


def test_temperatures_follow_the_room() -> None:
    frame = WarmingFrame(
        axis="x", room_step=2.0, room_ramp=30.0, frame_tau=0.01, stage_tau=0.04, expansion=1e-6
    )
    flow = np.array([[0, 0, 0, 30.0], [100, -100, 0, 0], [0, 25, -25, 0], [0, 0, 0, 0]])
    step = linalg.expm(flow * STEP)
    state, expected = np.array([2.0, 0.0, 0.0, 1.0]), []
    for _ in range(3000):
        expected.append(1e-6 * (state[1] - state[2]))
        state = step @ state
    np.testing.assert_allclose(act(frame, np.zeros(3000)), expected, rtol=1e-9)


def test_the_floor_is_chance_in_phase_and_nothing_else() -> None:
    floor = FloorVibration(axis="x", amplitude=1e-6, frequency=50.0, harmonics=(0.5,))
    one, same, other = (act(floor, np.zeros(40_000), seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    lines = np.abs(np.fft.rfft([one, other])) / 20_000
    np.testing.assert_allclose(lines[0], lines[1], atol=1e-15)
    assert np.flatnonzero(lines[0] > 1e-10).tolist() == [10, 20]
    assert np.max(np.abs(one - other)) > 1e-8


@pytest.mark.parametrize("length", [30e-6, 100e-6])
def test_a_stiffened_flexure_is_in_balance(length: float) -> None:
    x = act(StiffeningFlexure(axis="x", length=length), WAVE)
    np.testing.assert_allclose(x * (1.0 + (x / length) ** 2), WAVE, atol=1e-18)


def test_a_tilted_plate_reads_what_parallel_plates_would() -> None:
    gap, wedge = 100e-6, 40e-6
    reading = act(TiltedPlate(axis="x", gap=gap, wedge=wedge), np.array([0.0, 1e-9, 20e-6]))

    def capacitance(x: float) -> float:
        across = np.linspace(-1.0, 1.0, 20_001)
        return float(np.mean(1.0 / (gap - x + wedge * across)))

    def parallel(x: float) -> float:
        return float(optimize.brentq(lambda d: 1.0 / d - capacitance(x), 1e-6, gap))

    slope = (parallel(0.0) - parallel(1e-6)) / 1e-6
    assert reading[0] == pytest.approx(0.0, abs=1e-18)
    assert reading[1] == pytest.approx(1e-9, rel=1e-5)
    assert reading[2] == pytest.approx((parallel(0.0) - parallel(20e-6)) / slope, rel=0.01)
    with pytest.raises(ScanError, match="plates touch"):
        act(TiltedPlate(axis="x", gap=gap, wedge=wedge), np.array([61e-6]))
    with pytest.raises(InputError, match="closes the gap"):
        TiltedPlate(axis="x", gap=gap, wedge=gap)


def test_a_loose_joint_has_its_play() -> None:
    joint = LooseJoint(axis="x", gap=1e-6, contact_time=5e-6)
    there = act(joint, np.concatenate((np.full(200, 5e-6), np.full(200, 3.5e-6))))
    assert there[199] == pytest.approx(4e-6)
    np.testing.assert_allclose(there[199:], 4e-6)
    assert act(joint, np.full(200, -5e-6))[-1] == pytest.approx(-4e-6)


def test_an_encoder_errs_twice_a_period() -> None:
    encoder = CyclicEncoder(axis="x", period=8e-6, inequality=0.3)
    x = np.linspace(0.0, 16e-6, 401)
    error = act(encoder, x) - x
    np.testing.assert_allclose(error[100:], error[:-100], atol=1e-18)
    phase = 2.0 * np.pi * x / 8e-6
    ellipse = np.unwrap(np.arctan2(0.7 * np.sin(phase), 1.3 * np.cos(phase)))
    np.testing.assert_allclose(error, ellipse * 8e-6 / (2.0 * np.pi) - x, atol=1e-17)


def test_tilt_and_bow_know_the_other_axis() -> None:
    other = np.cos(np.arange(WAVE.size)) * 1e-5
    tilted = act(TiltedSensor(axis="x", angle=0.1), WAVE, other)
    np.testing.assert_allclose(tilted, np.cos(0.1) * WAVE + np.sin(0.1) * other)
    bowed = act(ScannerBow(axis="x", arm=1e-3), WAVE, other)
    np.testing.assert_allclose(bowed - WAVE, 1e3 * WAVE * other, atol=1e-18)


@pytest.mark.parametrize(
    ("attachment", "carried"),
    [
        (RidingMass(axis="x", mass_ratio=0.2, frequency=800.0, damping=0.01), (1.0, 0.0)),
        (CoupledStage(axis="x", share=0.05, frequency=330.0, damping=0.02), (0.5, 0.5)),
    ],
)
def test_a_body_moves_as_its_matrix_says(
    attachment: RidingMass | CoupledStage, carried: tuple[float, float]
) -> None:
    """Under a step of both axes: the exponential of mass, spring and dashpot, by scipy."""
    body = attachment.attached(STAGE)
    assert isinstance(body, SprungBody)
    (a, b), k = carried, body.stiffness
    w, d, own, loss = STAGE.natural, STAGE.damping, body.natural, body.damping
    matrix = np.array(
        [
            [0, 1, 0, 0, 0],
            [-(w**2) * (1 + k * a), -2 * d * w, w**2 * k, 0, -(w**2) * k * a],
            [0, 0, 0, 1, 0],
            [own**2 * a, 0, -(own**2), -2 * loss * own, own**2 * (a + b)],
            [0, 0, 0, 0, 0],
        ]
    )
    step, state, expected = linalg.expm(matrix * STEP), np.array([0, 0, 0, 0, 1e-6]), []
    for _ in range(3000):
        state = step @ state
        expected.append(state[0])
    path = np.full((2, 3001), 1e-6)
    moving = np.concatenate((np.zeros(2), body.own_at_rest()))
    np.testing.assert_allclose(body.integrate(moving, path, STEP), expected, atol=1e-12)


def test_a_coupled_axis_moves_by_its_share_at_last() -> None:
    body = CoupledStage(axis="x", share=0.03, frequency=330.0, damping=0.3).attached(STAGE)
    state = body.at_rest(STEP, RNG)
    _, moved = body.apply(state, np.vstack((np.zeros(200_000), np.full(200_000, 1e-6))), STEP)
    assert moved[0, -1] == pytest.approx(0.03e-6, rel=1e-3)
    np.testing.assert_array_equal(moved[1], 1e-6)


def test_a_tube_that_never_yields_is_a_stiffer_one() -> None:
    springs = YieldingTube(axis="x", share=0.1, reaches=(1.0,)).attached(STAGE)
    pushed = np.vstack((np.full(400_000, 1e-6), np.zeros(400_000)))
    _, moved = springs.apply(springs.at_rest(STEP, RNG), pushed, STEP)
    assert moved[0, -1] == pytest.approx(1e-6 / 1.1, rel=1e-6)
    spectrum = np.abs(np.fft.rfft(moved[0, 1:200_001] - moved[0, -1]))
    assert spectrum.argmax() == pytest.approx(454.0 * np.sqrt(1.1), abs=1.0)


def test_a_tube_that_yields_gains_and_loses_the_more_it_bends() -> None:
    springs = YieldingTube(axis="x", share=0.1, reaches=(1e-6, 4e-6)).attached(STAGE)
    turn = 2.0 * np.pi * np.arange(80_000) / 40_000
    gains, losses = [], []
    for amplitude in (1e-8, 1e-6, 1e-5):
        push = np.vstack((amplitude * np.sin(turn), np.zeros(turn.size)))
        _, moved = springs.apply(springs.at_rest(STEP, RNG), push, STEP)
        phasor = np.mean(moved[0, 40_000:] * np.exp(-1j * turn[40_000:])) * 2j / amplitude
        gains.append(abs(phasor))
        losses.append(-np.angle(phasor))
    assert gains[0] == pytest.approx(1.0 / 1.1, rel=1e-3)
    assert gains[0] < gains[1] < gains[2]
    assert losses[1] > 0.005 > abs(losses[0])


def test_alterations_change_what_they_name(plant: PlantSpec) -> None:
    axis = plant.x
    heavier = HeavierLoad(axis="x", mass_ratio=0.21).altered(axis)
    was, now = (first_resonance(each.vibration) for each in (axis, heavier))
    assert abs(now) == pytest.approx(abs(was) / 1.1)
    assert now.real == pytest.approx(was.real / 1.21)  # half of dashpot over mass
    aged = AgedCreep(axis="x", factor=1.5).altered(axis)
    (gains, taus), (old_gains, old_taus) = series(aged.creep), series(axis.creep)
    np.testing.assert_allclose(gains, 1.5 * old_gains, rtol=1e-9)
    np.testing.assert_allclose(taus, old_taus, rtol=1e-9)
    omega = np.array([0.0, 1.0, 2800.0, 8700.0])
    poled = LostPoling(axis="x", loss=0.1).altered(axis)
    whole, left = (Dynamics.from_spec(each, 1.0).response(omega) for each in (axis, poled))
    np.testing.assert_allclose(left, 0.9 * whole, rtol=1e-9)
