"""The operator of one state: what it follows, starts from and is on other cells."""

import numpy as np
import pytest

from afm_scan_ros.core.effects.hysteresis.duhem import Duhem
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.types import Array
from helpers.fit_cases import LIMIT, OPERATORS, applied, levels, of_duhem


def missed_by_start(path: Array, output: Array) -> float:
    """Standard deviation (V) of what the start misses of an output."""
    low, high = (output - path).min(), (output - path).max()
    operator = OneState(-LIMIT, LIMIT, (low - 0.05, high + 0.05))
    theta = operator.started([(path, output)])
    return float(np.std(operator.output(theta, path, np.zeros(2)) - output))


@pytest.mark.parametrize("family", ["duhem", "bouc_wen"])
def test_one_state_follows_scanners_without_wiping_out(family: str) -> None:
    path = levels(2, 60, 300)
    output = applied(OPERATORS[family], path)
    assert missed_by_start(path, output) < 2e-3 * np.ptp(output)


def test_one_state_starts_from_a_path_that_it_makes() -> None:
    """Slopes linear in u and w are splines exactly; the weakest prior is left."""
    path = levels(2, 60, 300)
    output = of_duhem(path)
    assert missed_by_start(path, output) < 1e-5 * np.ptp(output)


def test_slopes_stay_the_same_on_cells_that_reach_further() -> None:
    path = levels(2, 60, 300)
    output = applied(OPERATORS["duhem"], path)
    operator = OneState(-LIMIT, LIMIT, (-0.3, 0.3))
    theta = operator.started([(path, output)])
    before = operator.output(theta, path, np.zeros(2))
    wider, moved = operator.covering(theta, np.array([-0.36, 0.4]))
    apart = wider.output(moved, path, np.zeros(2)) - before
    assert np.std(apart) < 2e-3 * np.ptp(before)
    assert wider.widths[0] < -0.36
    assert wider.widths[1] > 0.4
    assert wider.covering(moved, np.array([-0.36, 0.4]))[0] is wider


@pytest.mark.parametrize("seed", range(5))
def test_no_path_leaves_the_cells(seed: int) -> None:
    """Slopes that no record tells may be any; without their conditions w runs away by volts."""
    rng = np.random.default_rng(seed)
    operator = OneState(-LIMIT, LIMIT, (-0.3, 0.4))
    theta = np.clip(rng.normal(0.0, 1.0, operator.parts["slopes"]), operator.lowest, None)
    path = levels(seed, 60, 300)
    output = Duhem(operator.slopes(theta, np.zeros(1)))
    _, moved = output.apply(output.at_rest(), path)
    w = moved - moved[0] - path
    margin = 0.02 * (operator.widths[1] - operator.widths[0])
    assert operator.widths[0] - margin <= w.min()
    assert w.max() <= operator.widths[1] + margin


def test_conditions_are_linear_and_met_by_slopes_of_the_drive() -> None:
    operator = OneState(-LIMIT, LIMIT, (-0.3, 0.4))
    assert len(operator.lacking(operator.unbent())[1]) == 0
    theta = np.random.default_rng(1).normal(0.0, 1.0, operator.parts["slopes"])
    rows, lacks = operator.lacking(theta)
    assert len(lacks) > 0
    np.testing.assert_allclose(rows @ theta, -lacks)
