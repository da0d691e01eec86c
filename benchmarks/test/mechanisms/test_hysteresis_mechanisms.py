"""Mechanisms of hysteresis.py, each against the solution of its equation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from afm_scan_bench.mechanisms.hysteresis import (
    ActivatedBlocks,
    CracklingDomains,
    HardenedDomains,
    HastenedBlocks,
    ThinningBlocks,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.acting import STEP, act

BLOCK = PlayBank(np.array([0.1]), np.array([1.0]), 1.0, 0.0, 0.0)


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


def test_domains_crackle_along_the_way_and_rest_at_rest() -> None:
    crackling = CracklingDomains(axis="x", amplitude=0.1, length=0.4)
    drive = np.concatenate((np.zeros(10), 3.0 * np.sin(np.arange(500) / 50.0)))
    noise = act(crackling, drive) - drive
    np.testing.assert_array_equal(noise[:11], 0.0)
    np.testing.assert_allclose(act(crackling, -drive) + drive, noise, atol=1e-12)
    slowly = np.repeat(drive, 3)
    np.testing.assert_allclose(act(crackling, slowly)[::3], noise + drive, atol=1e-12)
    assert np.std(act(crackling, drive, seed=1) - drive - noise) > 0.05


def test_what_has_crackled_is_forgotten_along_the_way() -> None:
    crackling, way = CracklingDomains(axis="x", amplitude=0.1, length=0.4), np.linspace(0, 4, 41)
    grown = np.mean([(act(crackling, way, seed=s) - way) ** 2 for s in range(1000)], axis=0)
    expected = 2.0 * 0.1**2 * (1.0 - np.exp(-way / 0.4))
    np.testing.assert_allclose(grown[1:].mean(), expected[1:].mean(), rtol=0.1)
    np.testing.assert_allclose(grown[1:4], expected[1:4], rtol=0.15)
