"""Mechanisms behind the structure, each against the solution of its equation."""

import numpy as np
import pytest
from scipy import linalg, optimize

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.electronics import CyclicEncoder, TiltedPlate, TiltedSensor
from afm_scan_ros.simulation.mechanisms.environment import FloorVibration, WarmingFrame
from afm_scan_ros.simulation.mechanisms.material import CreepingMount
from afm_scan_ros.simulation.mechanisms.structure import LooseJoint, ScannerBow, StiffeningFlexure

STEP = 5e-6
WAVE = 10e-6 * np.sin(np.arange(4000) * 2.0 * np.pi / 1000.0)


def act(insert: Insert, own: Array, other: Array | None = None, seed: int = 0) -> Array:
    state = insert.at_rest(STEP, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own) if other is None else other, STEP)[1]


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
