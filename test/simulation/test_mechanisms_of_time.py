"""Mechanisms that change with the time since the scanner was switched on."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.mechanisms.attachment import AttachedStage
from afm_scan_ros.simulation.mechanisms.base import Ageing, Mechanism
from afm_scan_ros.simulation.mechanisms.environment import ChangingLoad, SettlingFrame, SwingingRoom
from afm_scan_ros.simulation.mechanisms.structure import HeavierLoad
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec
from helpers import mechanism_laws as laws
from helpers.mechanism_laws import PERIOD, X, run

PLANTS = sorted((share_directory() / "config/changing").glob("*.yaml"))
every_plant = pytest.mark.parametrize("path", PLANTS, ids=lambda path: path.stem)
AGE = 600.5
"""When all of them act, s."""
LOAD = ChangingLoad(axis="x", mass_ratio_before=0.0, mass_ratio_after=0.06, begin=0.0, end=600.0)
DRIFTS = (
    SettlingFrame(axis="x", speed=1.5e-6, tau=100.0),
    SwingingRoom(axis="x", speed=1.5e-6, period=20.0),
)


def aged(path: Path) -> tuple[Mechanism, ...]:
    return load_plant(path).older(AGE).mechanisms


@every_plant
@settings(deadline=None, max_examples=5)
@given(cuts=st.sets(st.integers(1, X.size - 1), max_size=5))
def test_cutting_into_blocks_changes_nothing(plant: PlantSpec, path: Path, cuts: set[int]) -> None:
    laws.cutting_into_blocks_changes_nothing(plant, aged(path), cuts)


@every_plant
def test_the_future_does_not_act(plant: PlantSpec, path: Path) -> None:
    laws.the_future_does_not_act(plant, aged(path))


@every_plant
def test_the_step_of_integration_does_not_matter(
    plant: PlantSpec, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    laws.the_step_of_integration_does_not_matter(plant, aged(path), monkeypatch)


@pytest.mark.parametrize("drift", DRIFTS, ids=lambda each: each.KIND)
@settings(deadline=None, max_examples=10)
@given(samples=st.integers(1, 1000))
def test_a_drift_goes_on_where_the_scan_before_ended(
    plant: PlantSpec, drift: Ageing, samples: int
) -> None:
    drifting, still = evolve(plant, mechanisms=(drift,)), np.zeros(2000)
    whole = run(drifting, x=still, y=still)[0]
    later = run(drifting.older(samples * PERIOD), x=still, y=still)[0]
    np.testing.assert_allclose(
        later[: 2000 - samples], whole[samples:] - whole[samples], atol=1e-15
    )


def test_a_drift_that_swings_reverses() -> None:
    swung = SwingingRoom(axis="x", speed=1e-6, period=20.0)
    instants = np.array([0.0, 5.0, 10.0, 15.0])
    moved = np.diff(swung.at(instants, np.zeros(4), None))
    np.testing.assert_allclose(moved, np.array([1.0, -1.0, -1.0]) * 1e-5 / np.pi, rtol=1e-9)


def alone(plant: PlantSpec) -> PlantSpec:
    """Return the scanner without the mode beside the polynomials, which a mass damps too."""
    return evolve(plant, x=evolve(plant.x, modes=()))


@pytest.mark.parametrize(("age", "ratio"), [(300.0, 0.03), (600.0, 0.06), (9000.0, 0.06)])
def test_a_load_that_has_changed_is_a_heavier_load(
    plant: PlantSpec, age: float, ratio: float
) -> None:
    healthy = alone(plant)
    changed = run(evolve(healthy, mechanisms=(LOAD,)).older(age))[0]
    heavier = run(evolve(healthy, mechanisms=(HeavierLoad(axis="x", mass_ratio=ratio),)))[0]
    moved = np.std(heavier - run(healthy)[0])
    assert np.std(changed - heavier) < 1e-3 * moved


def test_a_changing_load_obeys_its_equation() -> None:
    """(1 + m) u'' + 2 d w u' + w^2 u = -m x_d'', solved by another method."""
    natural, damping, step, count, turn = 2e3, 0.02, 5e-6, 2000, 500.0
    load = evolve(LOAD, mass_ratio_after=0.5, end=count * step)
    time = step * np.arange(count + 1)
    path = np.stack([1.0 - np.cos(turn * time)] * 2)
    u = load.attached(AttachedStage(natural, damping)).integrate(np.zeros(3), path, step)

    def slopes(t: float, state: Array) -> list[float]:
        mass = 0.5 * t / time[-1]
        force = mass * turn**2 * np.cos(turn * t) + 2.0 * damping * natural * state[1]
        return [state[1], -(force + natural**2 * state[0]) / (1.0 + mass)]

    whole = solve_ivp(slopes, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(u, whole.y[0, 1:], atol=1e-4 * np.ptp(u))


def test_an_impossible_age_or_change_is_refused(plant: PlantSpec) -> None:
    with pytest.raises(InputError, match="age = -1 s must be 0 or more"):
        Piezoscanner(plant, PERIOD, 1, age=-1.0)
    with pytest.raises(InputError, match="end = 0 s is not after begin = 0 s"):
        evolve(LOAD, end=0.0)


def test_a_scanner_without_age_is_as_before(plant: PlantSpec) -> None:
    drive = Trace(0, PERIOD, X, X)
    young, old = (Piezoscanner(plant, PERIOD, 1, age=age).advance(drive) for age in (0.0, 1e5))
    np.testing.assert_array_equal(young[0].x, old[0].x)
