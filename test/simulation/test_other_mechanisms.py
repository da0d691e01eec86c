"""The mechanisms of other_sizes.py, each against the solution of its equation."""

import numpy as np
import pytest
from scipy import integrate

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.averaging_sensor import AveragingSensor
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.mechanisms.hastened_blocks import HastenedBlocks
from afm_scan_ros.simulation.mechanisms.heated_rod import HeatedRod
from afm_scan_ros.simulation.mechanisms.rubbing_guide import RubbingGuide
from afm_scan_ros.simulation.mechanisms.saturating_sensor import SaturatingSensor
from afm_scan_ros.simulation.mechanisms.supply_ripple import SupplyRipple
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6
STAGE = Stage(2.0 * np.pi * 454.0, 0.012)
RNG = np.random.default_rng(0)


def act(insert: Insert, own: Array, step: float = STEP, seed: int = 0) -> Array:
    state = insert.at_rest(step, np.random.default_rng(seed))
    return insert.act(state, own, np.zeros_like(own), step)[1]


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
