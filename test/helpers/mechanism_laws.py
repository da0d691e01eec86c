"""Laws that hold for the mechanisms of every scanner."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation import scanner as scanner_module
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

PERIOD = 3.3e-5
TIME = np.arange(1200) * PERIOD
X = 3.0 * np.sin(300.0 * TIME) * np.minimum(1.0, 100.0 * TIME)
Y = 2.0 * np.sin(90.0 * TIME)

Mechanisms = tuple[Mechanism, ...]
SIZES = ("small", "medium", "large")


def run(plant: PlantSpec, *cuts: int, x: Array = X, y: Array = Y, period: float = PERIOD) -> Array:
    """True displacement, m, shape (2, n)."""
    scanner = Piezoscanner(plant, period, seed=3)
    edges = [0, *cuts, x.size]
    blocks = (Trace(a, period, x[a:b], y[a:b]) for a, b in pairwise(edges))
    return np.hstack([[path.x, path.y] for _, path in map(scanner.advance, blocks)])


def cutting_into_blocks_changes_nothing(
    plant: PlantSpec, mechanisms: Mechanisms, cuts: set[int]
) -> None:
    altered = evolve(plant, mechanisms=mechanisms)
    np.testing.assert_array_equal(run(altered, *sorted(cuts)), run(altered))


def it_moves_its_axis_alone_and_more_the_larger(
    plant: PlantSpec, sized: Callable[[str], Mechanisms], axis: str
) -> None:
    healthy, row = run(plant), AXES.index(axis)
    altered = [run(evolve(plant, mechanisms=sized(size))) for size in SIZES]
    moved = [np.std((each - healthy)[row]) for each in altered]
    assert 0.0 < moved[0] < moved[1] < moved[2]
    for each in altered:
        np.testing.assert_allclose(each[1 - row], healthy[1 - row], rtol=0, atol=1e-13)


def the_future_does_not_act(plant: PlantSpec, mechanisms: Mechanisms) -> None:
    altered = evolve(plant, mechanisms=mechanisms)
    changed = X + np.where(np.arange(X.size) >= 700, 0.5, 0.0)
    first, second = run(altered), run(altered, x=changed)
    np.testing.assert_array_equal(second[:, :701], first[:, :701])
    assert np.any(second[:, 701:] != first[:, 701:])


def the_step_of_integration_does_not_matter(
    plant: PlantSpec, mechanisms: Mechanisms, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of mechanisms that act on x."""
    altered = evolve(plant, mechanisms=mechanisms)
    healthy, coarse = run(plant), run(altered)
    monkeypatch.setattr(scanner_module, "STEP", 1e-6)
    assert np.std((run(altered) - coarse)[0]) < 0.002 * np.std((coarse - healthy)[0])
