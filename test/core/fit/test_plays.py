"""Plays as an operator and as the Everett surface of a model."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.descent import settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.plays import Plays as PlayBank
from afm_scan_ros.core.fit.surfaces import everett_surface, from_rest
from afm_scan_ros.core.types import Array
from helpers.fit_cases import GAIN, LIMIT, SETTINGS, levels, of_plays_alone


def rest(bank: PlayBank, value: float = 0.0) -> Array:
    return bank.at_rest(np.array([value]))[0]


@pytest.fixture(scope="module")
def drive() -> Array:
    return levels(1, 14, 600)


def test_the_plays_are_the_surface_of_the_model(drive: Array) -> None:
    rng = np.random.default_rng(5)
    bank = PlayBank(-LIMIT, LIMIT)
    plays, terms = bank.parts["density"], bank.parts["correction"]
    density = np.concatenate([[0.8], 0.3 * rng.random(plays - 1)])
    theta = np.concatenate([density, 0.02 * rng.standard_normal(terms)])
    value = 0.1
    bias, _ = bank.bias(np.array([value]))
    model = Preisach(everett_surface(bank, theta, bias))
    of_model = model.apply(model.at_rest(), drive)[1]
    of_plays = bank.output(theta, drive, rest(bank, value))
    assert np.ptp(of_model - of_plays) < 3e-4 * np.ptp(of_plays)


@given(seed=st.integers(0, 10_000), spread=st.sampled_from([0.0, 0.1, 3.0]))
@settings(max_examples=20)
def test_each_play_moves_as_it_would_alone(seed: int, spread: float) -> None:
    """Also from memories in which neighbours lie farther apart than any drive leaves them."""
    rng, bank = np.random.default_rng(seed), PlayBank(-LIMIT, LIMIT)
    path, memory = levels(seed, 6, 60), spread * rng.standard_normal(bank.unknowns)
    theta = bank.unbent()
    theta[: bank.parts["density"]] = rng.normal(size=bank.parts["density"])
    start, tables, expected = bank.in_use(path[0], memory)[0], bank.tables(theta), []
    plays = start.copy()
    for volts in path:
        plays = np.minimum(volts + bank.thresholds, np.maximum(volts - bank.thresholds, plays))
        each = zip(plays, tables, strict=True)
        expected.append(sum(np.interp(play, bank.positions, table) for play, table in each))
    np.testing.assert_allclose(bank.output(theta, path, start), expected, atol=1e-9)


@given(seed=st.integers(0, 10_000), low=st.floats(-10.0, 10.0), swing=st.floats(1.0, 10.0))
@settings(max_examples=20, deadline=None)
def test_plays_in_the_middle_put_out_the_middle_of_any_range(
    seed: int, low: float, swing: float
) -> None:
    """So the map behind them bends where records are, also those of a drive of one sign."""
    rng, bank = np.random.default_rng(seed), PlayBank(low, low + swing)
    assume(bank.thresholds[-1] > bank.half)
    middle = low + 0.5 * swing
    theta = rng.standard_normal(sum(bank.parts.values()))
    still = np.full(2, middle)
    np.testing.assert_allclose(bank.output(theta, still, bank.origins), middle, atol=1e-9)
    (columns,) = bank.pieces(theta, still, np.array([0, 2]), bank.origins)
    np.testing.assert_allclose(columns, 0.0, atol=1e-6)
    away = low + swing * rng.random(200)
    (slopes,) = bank.pieces(theta, away, np.arange(201), bank.origins)
    expected = middle + slopes.astype(float) @ theta
    np.testing.assert_allclose(bank.output(theta, away, bank.origins), expected, atol=2e-3 * swing)


@pytest.mark.parametrize(("low", "high"), [(0.0, 5.0), (-1.0, 4.0), (-3.0, 3.0)])
def test_a_model_rests_at_zero_and_moves_as_the_plays_do(low: float, high: float) -> None:
    """Also where plays move once from rest and never again: what they moved by is an offset."""
    bank = PlayBank(low, high)
    theta = bank.unbent()
    theta[: bank.parts["density"]] = np.linspace(0.9, 0.3, bank.parts["density"])
    surface, _ = from_rest(everett_surface(bank, theta), None)
    model = Preisach(surface)
    assert model.at_rest().now[1] == pytest.approx(0.0, abs=1e-12)
    path = np.interp(np.arange(700), np.arange(0, 701, 100), [0, high, low, high, 1, 3, 0.5, 2])
    apart = model.apply(model.at_rest(), path)[1] - bank.output(theta, path, rest(bank))
    assert np.ptp(apart[200:]) < 1e-3 * (high - low)


@given(seed=st.integers(0, 10_000), low=st.sampled_from([-LIMIT, 0.0]))
@settings(max_examples=10)
def test_conditions_tell_where_a_surface_does_not_grow(seed: int, low: float) -> None:
    """They are linear in the weights, and none fails where the model has an inverse."""
    rng, plays = np.random.default_rng(seed), PlayBank(low, LIMIT)
    theta = plays.unbent()
    theta[1:] = rng.normal(0.0, 10.0 ** rng.uniform(-2.0, 0.5), theta.size - 1)
    rows, lacks = plays.lacking(theta)
    if len(lacks) == 0:
        everett_surface(plays, theta)
        return
    least = SETTINGS.least_slope / SETTINGS.slope_tolerance
    if lacks.max() > 1.01 * least:
        with pytest.raises(InputError, match="does not grow"):
            everett_surface(plays, theta)
    mixed = everett_surface(plays, theta, mixed=True)
    lowest = 2.0 * np.diff(mixed.values, axis=0)[np.tri(len(mixed.values), dtype=bool)[:-1]].min()
    assert lowest / np.diff(mixed.levels)[0] > 0.99 * SETTINGS.least_slope
    move = 1e-9 * rng.standard_normal(theta.size)
    _, moved = plays.lacking(theta + move)
    np.testing.assert_allclose(moved - lacks, -rows @ move, atol=1e-6 * least)


def test_plays_that_no_surface_has_are_held_to_one() -> None:
    """A response that falls as the drive goes on rising after each turn."""
    drive = levels(2, 40, 80)
    operator = PlayBank(-LIMIT, LIMIT)
    theta = operator.unbent()
    theta[1 : len(operator.thresholds)] = 0.5
    theta[12:20] = -12.0
    with pytest.raises(InputError, match="does not grow"):
        everett_surface(operator, theta)
    moved = GAIN * operator.output(theta, drive, rest(operator))
    fit = AxisFit(*of_plays_alone(drive, moved))
    settle(fit, 20, ("density", "correction"))
    with pytest.raises(InputError, match="does not grow"):
        everett_surface(operator, fit.layout.of_operator(fit.theta))
    fit.grows = True
    settle(fit, 20, ("density", "correction"))
    found = everett_surface(operator, fit.layout.of_operator(fit.theta))
    assert found.output_upper > found.output_lower


@given(seed=st.integers(0, 10_000), low=st.sampled_from([0.0, -0.3 * LIMIT, -LIMIT]))
@settings(max_examples=20)
def test_a_model_of_any_range_moves_from_rest_as_its_plays_do(seed: int, low: float) -> None:
    """Also in the first rise of a drive of one sign, which moves each play once."""
    rng, plays = np.random.default_rng(seed), PlayBank(low, LIMIT)
    theta = plays.unbent()
    theta[1 : len(plays.thresholds)] = rng.uniform(0.0, 0.6, len(plays.thresholds) - 1)
    surface, _ = from_rest(everett_surface(plays, theta), None)
    assert surface.drive_range == (low, LIMIT)
    model = Preisach(surface)
    turns = rng.uniform(low, LIMIT, 8)
    path = np.interp(np.arange(900), np.arange(0, 901, 100), [0.0, *turns, LIMIT])
    moved = plays.output(theta, path, rest(plays))
    found = model.apply(model.at_rest(), path)[1]
    np.testing.assert_allclose(found, moved - moved[0], atol=2e-3 * np.ptp(moved))
    with pytest.raises(BeyondRangeError):
        model.apply(model.at_rest(), np.array([1.01 * LIMIT]))
    with pytest.raises(BeyondRangeError):
        model.apply(model.at_rest(), np.array([low - 0.01 * LIMIT]))
    back = model.invert(model.at_rest(), found)[1]
    np.testing.assert_allclose(back, path, atol=1e-9 * LIMIT)
