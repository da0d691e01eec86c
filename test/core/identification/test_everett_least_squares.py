"""Surfaces fitted to curves of a Preisach model whose surface is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import (
    FittedSurface,
    fit_surface,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurve

GRID = EverettGrid(-2.0, 3.0, 9)
FALL = GRID.levels[:, None] - GRID.levels
TRUTH = EverettSurface(-2.0, 3.0, np.tril(FALL + 0.1 * FALL**2 + 0.02 * FALL**3), -1.5)
TURNS = np.linspace(-2.0, 3.0, 21)


def curve(start: float, turn: float) -> ReversalCurve:
    model = Preisach(TRUTH)
    approach = np.concatenate([[-2.0], [3.0] if start > 0.0 else [], np.linspace(start, turn, 9)])
    inputs = np.linspace(turn, start, 60)
    outputs = model.apply(model.saturated(), np.concatenate([approach, inputs]))[1]
    return ReversalCurve(inputs, outputs[len(approach) :])


FALLING = [curve(-2.0, turn) for turn in TURNS[1:]]
RISING = [curve(3.0, turn) for turn in TURNS[:-1]]


@given(
    alpha=st.floats(-2.0, 3.0),
    share=st.floats(0.0, 1.0),
)
@settings(deadline=None)
def test_weights_read_the_surface_as_the_model_does(alpha: float, share: float) -> None:
    beta = max(alpha - share * (alpha + 2.0), -2.0)
    read = GRID.weights(np.array([alpha]), np.array([beta])) @ TRUTH.values.ravel()
    model = Preisach(TRUTH)
    rise, fall = model.apply(model.saturated(), np.array([alpha, beta]))[1]
    assert read[0] == pytest.approx((rise - fall) / 2.0, abs=1e-12)


@pytest.mark.parametrize("curves", [FALLING, RISING, FALLING + RISING])
def test_surface_is_recovered_from_either_family(curves: list[ReversalCurve]) -> None:
    fitted = fit_surface(curves, GRID, strength=1e-6)
    np.testing.assert_allclose(fitted.values, TRUTH.values, atol=1e-3)
    assert fitted.offset == pytest.approx(TRUTH.offset, abs=1e-3)
    for each in curves:
        np.testing.assert_allclose(fitted.predict(each), each.outputs, atol=5e-3)


def test_any_size_reads_the_same_surface() -> None:
    coarse, fine = (fit_surface(FALLING + RISING, EverettGrid(-2.0, 3.0, size)) for size in (9, 17))
    np.testing.assert_allclose(fine.values[::2, ::2], coarse.values, atol=0.01)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_few_levels_serve_too(size: int) -> None:
    fitted = fit_surface(FALLING + RISING, EverettGrid(-2.0, 3.0, size))
    assert fitted.values[-1, 0] == pytest.approx(TRUTH.values[-1, 0], rel=0.1)


def noisy(rng: np.random.Generator, sigma: float, grid: EverettGrid = GRID) -> FittedSurface:
    curves = [
        ReversalCurve(c.inputs, c.outputs + sigma * rng.standard_normal(len(c.inputs)))
        for c in FALLING + RISING
    ]
    return fit_surface(curves, grid)


def test_noise_and_its_standard_errors_are_those_put_in() -> None:
    rng = np.random.default_rng(1)
    found = [noisy(rng, 0.02) for _ in range(20)]
    errors = np.array([each.values - TRUTH.values for each in found])
    spread = np.sqrt(np.mean(errors**2, axis=0))[GRID.inside]
    stated = found[0].standard_errors()[GRID.inside]
    assert np.mean(spread) == pytest.approx(np.mean(stated), rel=0.15)
    assert found[0].noise < 0.02


def test_smoother_where_noise_is_greater() -> None:
    rng = np.random.default_rng(2)
    fine = EverettGrid(-2.0, 3.0, 33)
    strengths = [noisy(rng, sigma, fine).strength for sigma in (1e-4, 0.5)]
    assert strengths[0] < strengths[1]


def test_monotone_surface_stays_as_it_is() -> None:
    fitted = fit_surface(FALLING + RISING, GRID, strength=1e-6)
    np.testing.assert_array_equal(fitted.monotone().values, fitted.values)


def crossing() -> FittedSurface:
    """Noise of half a level's growth bends a free fit, so that it has no inverse."""
    rng = np.random.default_rng(3)
    curves = [
        ReversalCurve(c.inputs, c.outputs + 0.1 * rng.standard_normal(len(c.inputs)))
        for c in FALLING + RISING
    ]
    free = fit_surface(curves, EverettGrid(-2.0, 3.0, 33), strength=1e-2)
    with pytest.raises(InputError, match="has no inverse"):
        _ = free.surface
    return free


def test_raised_surface_has_an_inverse_and_lowers_nothing() -> None:
    free = crossing()
    raised = free.raised()
    assert isinstance(raised.surface, EverettSurface)
    assert np.all(raised.values >= free.values)
    assert np.mean(raised.values == free.values) > 0.5


def test_monotone_fit_has_an_inverse_and_is_no_farther_from_the_truth() -> None:
    """What holds the truth bends less."""
    free = crossing()
    held = free.monotone()
    assert isinstance(held.surface, EverettSurface)
    truth = np.concatenate([c.outputs for c in FALLING + RISING])
    errors = [
        np.concatenate([each.predict(c) for c in FALLING + RISING]) - truth for each in (free, held)
    ]
    assert np.sum(errors[1] ** 2) < np.sum(errors[0] ** 2)


def test_nothing_is_predicted_where_no_curve_has_data() -> None:
    reach = 1.0
    inner = [
        ReversalCurve(c.inputs[c.inputs <= reach], c.outputs[c.inputs <= reach]) for c in RISING[:8]
    ]
    alpha, beta = np.meshgrid(GRID.levels, GRID.levels, indexing="ij")
    where = (alpha <= reach) & (beta <= inner[-1].turn)
    lower = EverettGrid(-2.0, 3.0, 9)
    fitted = fit_surface([*inner, RISING[0]], lower, 1.0, where | (alpha == GRID.upper))
    unknown = GRID.inside & ~where & (alpha < GRID.upper)
    assert np.isnan(fitted.values[unknown]).all()
    assert np.isnan(fitted.monotone().values[unknown]).all()
    assert np.isnan(fitted.predict(RISING[15])).any()
    assert np.isnan(fitted.standard_errors()[unknown]).all()


def test_levels_lie_as_densely_as_curves_turn() -> None:
    turns = np.array([-1.5, -0.5, 0.0, 0.1, 0.2, 0.3, 0.5, 1.5, 2.0])
    grid = EverettGrid.by_turns(np.repeat(turns, 2) + [0.0, 1e-4] * 9, -2.0, 3.0, 21)
    np.testing.assert_allclose(grid.levels[2:-2:2], turns, atol=1e-12)
    np.testing.assert_allclose(grid.levels[1::2], 0.5 * (grid.levels[:-1:2] + grid.levels[2::2]))
    assert EverettGrid.by_turns(np.linspace(-1.5, 2.5, 9), -2.0, 3.0, 21).uneven is None


def test_levels_go_on_where_no_curve_turns_but_curves_pass() -> None:
    grid = EverettGrid.by_turns(np.linspace(-2.0, 0.5, 11), -2.0, 3.0, 41)
    assert np.diff(grid.levels).max() == pytest.approx(np.diff(grid.levels).min(), rel=1e-6)


def test_uneven_levels_fit_what_is_known_exactly() -> None:
    levels = 0.5 + 2.5 * np.sinh(np.linspace(-2.0, 2.0, 17)) / np.sinh(2.0)
    grid = EverettGrid(-2.0, 3.0, 17, levels)
    fitted = fit_surface(FALLING + RISING, grid)
    fall = levels[:, None] - levels
    expected = np.tril(fall + 0.1 * fall**2 + 0.02 * fall**3)
    np.testing.assert_allclose(fitted.values, expected, atol=0.01 * expected.max())
    assert fitted.surface.levels == pytest.approx(levels)
    assert grid.stretched(0.0, 1.0).levels == pytest.approx((levels + 2.0) / 5.0)
