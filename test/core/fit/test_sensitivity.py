"""Derivatives of a fit: of a simulation, of its misfit, and of the operator of one state."""

from itertools import product

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.effects.hysteresis.branches import mean_sensitivities, sensitivities
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import Layout, layout_of
from afm_scan_ros.core.fit.plays import Plays as PlayBank
from afm_scan_ros.core.fit.simulation import jacobian, pulled, simulate
from afm_scan_ros.core.fit.stretches import means
from afm_scan_ros.core.types import Array
from helpers.fit_cases import (
    DAMPING,
    FREQUENCY,
    LIMIT,
    PERIOD,
    SETTINGS,
    displaced,
    levels,
    of_plays,
    of_plays_alone,
    signals,
)


@pytest.fixture(scope="module")
def drive() -> Array:
    return levels(1, 14, 600)


KINDS = list(product(("plays", "one state"), (1, 4)))


def at_some_theta(
    kind: str, sensor_order: int = 0, *, delayed: bool = False
) -> tuple[Layout, Array, np.random.Generator]:
    rng = np.random.default_rng(3)
    operator = PlayBank(-LIMIT, LIMIT) if kind == "plays" else OneState(-LIMIT, LIMIT, (-1.5, 1.5))
    layout = layout_of(operator, 1.0, PERIOD, SETTINGS, 2.0 * np.pi * FREQUENCY)
    layout = evolve(layout, sensor_order=sensor_order, delayed=delayed)
    layout, theta = layout.with_mode(layout.start(), (2.0 * np.pi * FREQUENCY, DAMPING, 0.8, 0.1))
    for name, size in {"density": 0.3, "correction": 0.05, "slopes": 0.1, "map": 0.05}.items():
        if name in layout.parts:
            theta[layout.parts[name]] += size * rng.standard_normal(theta[layout.parts[name]].size)
    theta[layout.parts["creep"]] = 0.02 * rng.random(theta[layout.parts["creep"]].size)
    if delayed:  # where derivatives by all else do not see it
        theta[layout.parts["sensor"].stop - 1] = 1e-3 * PERIOD
    if sensor_order:
        theta[layout.parts["sensor"].start] = np.log(3.0 * FREQUENCY)
    theta[layout.parts["rest"]] = 0.3
    memory = 0.4 * operator.expected_memory() * rng.uniform(-1.0, 1.0, operator.unknowns)
    return evolve(layout, unknown_starts=1), np.concatenate([theta, memory]), rng


STARTS = {"rested": (True, None, 0), "in use": (False, None, 2), "unknown": (False, 0, 4)}
"""Whether a scanner rested, which unknown start it had, and the order of its sensor.

Where it is of order 2, it is delayed too.
"""


@pytest.mark.parametrize("sensor_order", [0, 2])
def test_derivatives_by_the_weights_of_a_further_mode_are_those_of_a_wider_model(
    drive: Array, sensor_order: int
) -> None:
    layout, theta, _ = at_some_theta("plays", sensor_order)
    one = evolve(signals(drive, 1e-6 * drive, 4), rested=False, unknown=None)
    narrow, wider, more = simulate(layout, theta, one), layout, theta
    for share in (0.6, 1.7):
        wider, more = wider.with_mode(more, (2.0 * np.pi * share * FREQUENCY, DAMPING, 0.0, 0.0))
    last = wider.parts["modes"].stop - wider.parts["lags"].start
    columns = simulate(wider, more, one).vibration[:, last - 8 : last]
    poles = wider.dynamics(more).poles[layout.modes : wider.modes]
    expected = columns[:, [2, 3, 6, 7]]
    np.testing.assert_allclose(narrow.by_weights(poles), expected, atol=1e-9 * abs(expected).max())


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("kind", "block"), KINDS)
def test_the_jacobian_is_the_derivative(drive: Array, kind: str, block: int, start: str) -> None:
    rested, unknown, order = STARTS[start]
    layout, theta, rng = at_some_theta(kind, order, delayed=order == 2)
    drive = drive if rested else drive + 0.3
    one, operator = signals(drive, 1e-6 * drive, block), layout.operator
    one = evolve(one, rested=rested, unknown=unknown)
    begun, _ = layout.start_of(theta, one)
    pieces = operator.pieces(layout.of_operator(theta), drive, one.edges, begun)
    of_pieces = jacobian(simulate(layout, theta, one), pieces)
    found = np.concatenate([piece for _, piece in of_pieces])
    known = layout.parts["sensor"].stop
    remembered = np.arange(layout.parts["creep"].stop, layout.size)
    for place in [*rng.choice(known, 60, replace=False), *remembered]:
        delay = layout.delayed and place == layout.parts["sensor"].stop - 1
        apart = 1e-5 * (PERIOD if delay else 1.0)
        step = apart * np.eye(layout.size)[place]
        up, down = (simulate(layout, theta + way * step, one) for way in (1.0, -1.0))
        slope = (up.output - down.output)[one.used] / (2.0 * apart)
        motion = float(np.linalg.norm(slope)) + 1e-6
        close = 0.003 if block == 1 else 0.02 if kind == "one state" else 0.15
        assert np.linalg.norm(slope - found[:, place]) < close * motion + 5e-5, place


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("kind", "block"), KINDS)
def test_residuals_are_pulled_back_by_the_same_jacobian(
    drive: Array, kind: str, block: int, start: str
) -> None:
    rested, unknown, order = STARTS[start]
    layout, theta, rng = at_some_theta(kind, order, delayed=order == 2)
    one = evolve(signals(drive, 1e-6 * drive, block), rested=rested, unknown=unknown)
    one = evolve(one, edges=np.unique([*one.edges[::3], one.edges[-1]]))
    at = simulate(layout, theta, one)
    given = layout.of_operator(theta), drive, one.edges
    pieces = list(layout.operator.pieces(*given, layout.start_of(theta, one)[0]))
    whole = np.concatenate([piece for _, piece in jacobian(at, pieces)])
    pull = rng.standard_normal((len(whole), 2))
    expected = whole.T @ pull
    found = pulled(at, pieces, pull)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * abs(expected).max())


def test_misfit_falls_as_the_normal_equations_say() -> None:
    """Also where what is free in a record has a prior that counts: waves of under a period."""
    rng = np.random.default_rng(5)
    drive = levels(4, 6, 300)
    moved = displaced(of_plays, drive) + 0.3e-6 * rng.standard_normal(len(drive))
    layout, given, gain, theta = of_plays_alone(drive, moved)
    seconds = PERIOD * len(drive)
    given = [evolve(one, tones=(0.3 / seconds, 0.9 / seconds), rested=False) for one in given]
    fit = AxisFit(layout, given, gain, theta)
    fit.weigh()
    right = fit.normal(with_operator=True)[1]
    for place in rng.choice(layout.parts["density"].stop, 30, replace=False):
        step = 1e-4 * np.eye(layout.size)[place]
        slope = (fit.misfit(theta - step) - fit.misfit(theta + step)) / 2e-4
        assert slope == pytest.approx(right[place], rel=0.02, abs=1e-3 * np.abs(right).max())


@pytest.mark.parametrize("block", [1, 4])
def test_sensitivities_of_one_state_are_those_of_its_steps(block: int) -> None:
    """Also of slopes so steep that a step crosses many cells, as fits pass through."""
    rng = np.random.default_rng(4)
    operator, path = OneState(-LIMIT, LIMIT, (-0.2, 0.2)), levels(3, 20, 200)
    theta = 2.0 * rng.random(operator.parts["slopes"]) - 0.5
    edges = np.cumsum([0, *np.tile([block, 3 * block], len(path) // (4 * block))])
    found = np.concatenate(list(operator.pieces(theta, path, edges, np.zeros(2))))
    for place in rng.choice(theta.size, 40, replace=False):
        step = 1e-6 * np.eye(theta.size)[place]
        up, down = (operator.output(theta + way * step, path, np.zeros(2)) for way in (1.0, -1.0))
        slope = means(up - down, edges) / 2e-6
        np.testing.assert_allclose(found[:, place], slope, atol=1e-3 * np.abs(slope).max() + 1e-7)


@pytest.mark.parametrize("fading", [8.0, -0.5])
def test_means_of_sensitivities_hold_however_fast_these_fade_or_grow(fading: float) -> None:
    """They share a scale within a block, which would take all digits of a sum with it."""
    operator, path = OneState(-LIMIT, LIMIT, (-0.2, 0.2)), levels(3, 20, 200)
    states = np.linspace(-0.2, 0.2, operator.shape[2])
    ways = np.array([-1.0, 1.0])[:, np.newaxis, np.newaxis]
    tables = fading * ways * np.ones((1, operator.shape[1], 1)) * states
    now, grown = np.zeros(2), np.zeros(tables.size)
    unknown = np.full(len(path), np.nan)
    each = sensitivities(tables, operator.cells, now.copy(), grown.copy(), path, unknown)[1]
    edges = np.arange(0, len(path), 100)
    found = mean_sensitivities(tables, operator.cells, now, grown, path, edges)
    expected = means(each, edges)
    largest = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / largest, expected / largest, atol=1e-11)
