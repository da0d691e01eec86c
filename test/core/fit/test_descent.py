"""Steps of a fit: bounded, bent, and none that undoes another."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.descent import _metric, bounded, cover, settle, step
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import layout_of
from afm_scan_ros.core.fit.plays import Plays as PlayBank
from afm_scan_ros.core.fit.simulation import simulate
from helpers.fit_cases import (
    DAMPING,
    FREQUENCY,
    GAIN,
    LIMIT,
    PERIOD,
    SETTINGS,
    displaced,
    levels,
    of_plays,
    of_plays_alone,
    signals,
)


@given(seed=st.integers(0, 10_000), size=st.integers(2, 40))
def test_no_bounded_least_squares_lowers_the_objective_more(seed: int, size: int) -> None:
    """SciPy's may end short of the least value, by 1e-6 of it for one seed of thousands."""
    rng = np.random.default_rng(seed)
    columns, data = rng.standard_normal((size + 5, size)), rng.standard_normal(size + 5)
    lowest = np.where(rng.random(size) < 0.7, -0.1 * rng.random(size), -np.inf)
    free = rng.random(size) < 0.9
    move = bounded(columns.T @ columns, columns.T @ data, free, lowest)
    ends = np.where(free, lowest, -1e-12), np.where(free, np.inf, 1e-12)
    options = {"method": "bvls", "tol": 1e-14, "max_iter": 100 * size}
    expected = optimize.lsq_linear(columns, data, ends, **options).x
    left, beside = (float(np.sum((columns @ each - data) ** 2)) for each in (move, expected))
    assert left < beside + 1e-9 * float(data @ data)
    assert np.all(move >= lowest)
    assert not move[~free].any()


def test_a_fit_that_overflows_says_so() -> None:
    drive = levels(4, 6, 300)
    fit = AxisFit(*of_plays_alone(drive, GAIN * drive))
    fit.gain = 1e200
    with pytest.raises(ScanError, match="diverged"):
        fit.normal(with_operator=True)


def test_a_step_to_a_mode_that_does_not_oscillate_is_none_downhill() -> None:
    drive, mode = levels(4, 6, 300), (2.0 * np.pi * FREQUENCY, DAMPING, 0.5, 0.0)
    layout, given, gain, theta = of_plays_alone(drive, GAIN * drive)
    layout, theta = layout.with_mode(theta, mode)
    fit = AxisFit(layout, given, gain, theta)
    theta = theta.copy()
    theta[layout.parts["modes"].start + 1] = -0.1
    assert fit.objective(theta) == np.inf
    with pytest.raises(InputError, match="oscillate"):
        fit.simulated(theta)


def test_a_fit_that_has_converged_tries_no_more_than_one_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drive = levels(4, 6, 300)
    noise = 1e-9 * np.random.default_rng(1).standard_normal(len(drive))
    fit = AxisFit(*of_plays_alone(drive, GAIN * of_plays(drive) + noise))
    settle(fit, SETTINGS.most_steps)
    while step(fit) > 0.0:
        fit.weigh()
    tried, objective = [], AxisFit.objective
    monkeypatch.setattr(AxisFit, "objective", lambda *of: tried.append(of) or objective(*of))
    step(fit)
    assert len(tried) == 2  # where it is, and where the step leads


def test_steps_follow_the_curve_of_a_valley() -> None:
    """The map behind plays makes one; of straight steps the third still brings 20 nat."""
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS, 2.0 * np.pi * FREQUENCY)
    layout, theta = layout.with_mode(layout.start(), (2.0 * np.pi * FREQUENCY, DAMPING, 1.0, 0.0))
    drive = levels(2, 40, 80)
    fit = AxisFit(layout, [signals(drive, displaced(of_plays, drive), 1)], 1e-6, theta, 1e-4)
    settle(fit, 4, [name for name in layout.parts if name != "map"])
    fell = [step(fit) for _ in range(3)]
    assert fell[0] > 100.0
    assert fell[2] < 0.1


def test_no_mode_becomes_broader_than_those_of_stages() -> None:
    operator = PlayBank(-LIMIT, LIMIT)
    layout = layout_of(operator, 1.0, PERIOD, SETTINGS, 2.0 * np.pi * FREQUENCY)
    sharp, broad = 0.03, SETTINGS.greatest_damping
    for damping, inside in ((sharp, True), (0.9 * broad, True), (1.1 * broad, False)):
        mode = 2.0 * np.pi * FREQUENCY, damping, 0.8, 0.1
        wider, theta = layout.with_mode(layout.start(), mode)
        assert wider.of_modes(theta) == [pytest.approx(mode)]
        part = wider.parts["modes"]
        assert bool((theta >= wider.lowest())[part].all()) is inside


def test_tables_stay_where_others_would_lose_what_a_step_gained() -> None:
    """The states reach beyond the cells, and the slopes bend more than wider cells can."""
    drive, rng = levels(2, 40, 80), np.random.default_rng(5)
    operator = OneState(-LIMIT, LIMIT, (-0.1, 0.1))
    layout = layout_of(operator, 1.0, PERIOD, SETTINGS)
    theta = layout.start()
    theta[layout.parts["slopes"]] = rng.uniform(-0.8, 0.8, operator.unbent().size)
    moved = GAIN * simulate(layout, theta, signals(drive, drive, 1)).output
    fit = AxisFit(layout, [signals(drive, moved, 1)], GAIN, theta, 1e-5)
    before = fit.objective(theta)
    assert cover(fit, 1.0) == 0.0
    assert fit.layout is layout
    assert fit.theta is theta
    lost = cover(fit, np.inf)
    assert lost > 1.0
    assert fit.objective(fit.theta) == pytest.approx(before + lost)
    assert fit.layout.operator != operator


def test_a_smooth_change_of_a_table_is_damped_less_than_one_of_single_coefficients() -> None:
    """The metric of the damping has the trace of the diagonal all the same."""
    drive = levels(3, 6, 200)
    operator = OneState(-LIMIT, LIMIT, (-0.2, 0.2), SETTINGS)
    layout = layout_of(operator, PERIOD * len(drive), PERIOD, SETTINGS)
    fit = AxisFit(layout, [signals(drive, displaced(of_plays, drive), 1)], GAIN, layout.start())
    precision, _ = layout.prior(fit.scales, fit.theta)
    matrix, _ = fit.normal(with_operator=True)
    metric, part = _metric(layout, matrix, precision), layout.parts["slopes"]
    assert np.trace(metric) == pytest.approx(np.trace(matrix + precision))
    smooth = np.ones(part.stop - part.start)
    rough = smooth * (-1.0) ** np.arange(len(smooth))
    own = np.diag(matrix + precision)[part].sum()  # of either, were the diagonal the metric
    assert smooth @ metric[part, part] @ smooth < 0.1 * own < own
    assert rough @ metric[part, part] @ rough > own
