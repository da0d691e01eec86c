"""Mechanisms of thermal.py, each against the solution of its equation."""

import numpy as np
from scipy import integrate

from afm_scan_bench.mechanisms.thermal import HeatedRod, RegulatedStage, WarmedPiezo
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import series
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.acting import act


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


def test_a_warm_piezo_moves_further_and_creeps_sooner(plant: PlantSpec) -> None:
    warm = WarmedPiezo(axis="x", kelvin=10.0).altered(plant.x)
    (gains, taus), (before, slower) = series(warm.creep), series(plant.x.creep)
    np.testing.assert_allclose(gains, before, rtol=1e-6)
    np.testing.assert_allclose(slower / taus, 2.17, rtol=1e-3)  # exp(6963 K (1/295 K - 1/305 K))
    further = np.array(warm.vibration.numerator) / plant.x.vibration.numerator
    np.testing.assert_allclose(further, 1.015)


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
