"""Creep: analytic step responses, superposition, exactness over hours, and what is refused."""

import numpy as np
import paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.errors import InputError

models = st.builds(
    lambda sections: CreepModel(*zip(*sections, strict=True)),
    st.lists(st.tuples(st.floats(-0.2, 0.5), st.floats(1e-3, 2000.0)), min_size=1, max_size=4),
)


def analytic_step(model: CreepModel, time: np.ndarray) -> np.ndarray:
    """Response of Gc to a unit step at time 0, taken just after it."""
    sections = zip(model.gains, model.time_constants, strict=True)
    return 1.0 + sum(-g * np.expm1(-time / tau) for g, tau in sections)


@pytest.mark.parametrize(
    ("polynomials", "static_gain"),
    [(paper.CREEP_X, 6.25e-5 / 4.69e-5), (paper.CREEP_Y, 1.48e-5 / 1.14e-5)],
)
def test_sections_are_the_papers_transfer_functions(
    polynomials: tuple[tuple[float, ...], tuple[float, ...]], static_gain: float
) -> None:
    """Eqs. 6 and 9; Gc(0) = 1.3326 in x."""
    model = paper.series(*polynomials)
    s = 1j * np.logspace(-5, 3, 50)
    sections = zip(model.gains, model.time_constants, strict=True)
    series = 1.0 + sum(g / (1.0 + s * tau) for g, tau in sections)
    ratio = np.polyval(polynomials[0], s) / np.polyval(polynomials[1], s)
    assert series == pytest.approx(ratio, rel=1e-9)
    assert 1.0 + sum(model.gains) == pytest.approx(static_gain, rel=1e-9)


@settings(deadline=None, max_examples=30)
@given(model=models, period=st.sampled_from([1e-5, 1e-3, 1.0]))
def test_the_step_response_is_exact_at_the_samples(model: CreepModel, period: float) -> None:
    effect = Creep(model, period)
    _, response = effect.apply(effect.at_rest(), np.ones(1000))
    expected = analytic_step(model, period * np.arange(1000))
    assert response == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "polynomials", [paper.CREEP_X, pytest.param(paper.CREEP_Y, marks=pytest.mark.evidence)]
)
def test_an_hour_at_100_khz_does_not_drift(
    polynomials: tuple[tuple[float, ...], tuple[float, ...]],
) -> None:
    model = paper.series(*polynomials)
    effect, block, period = Creep(model, 1e-5), np.ones(1_000_000), 1e-5
    state, last = effect.at_rest(), []
    for _ in range(360):
        state, response = effect.apply(state, block)
        last.append(response[-1])
    time = period * (len(block) * np.arange(1, 361) - 1)
    assert last == pytest.approx(analytic_step(model, time), rel=1e-9)


@settings(deadline=None, max_examples=30)
@given(model=models, seed=st.integers(0, 1000), a=st.floats(-3, 3), b=st.floats(-3, 3))
def test_superposition(model: CreepModel, seed: int, a: float, b: float) -> None:
    effect = Creep(model, 1e-2)
    u, v = np.random.default_rng(seed).normal(size=(2, 500))
    for step in (effect.apply, effect.invert):
        together = step(effect.at_rest(), a * u + b * v)[1]
        apart = a * step(effect.at_rest(), u)[1] + b * step(effect.at_rest(), v)[1]
        # Below the smallest normal number, digits are lost.
        scale = np.abs(apart).max() + np.abs(together).max() + np.finfo(float).tiny / 1e-11
        assert np.abs(together - apart).max() <= 1e-11 * scale


@pytest.mark.parametrize(
    ("gains", "time_constants", "names"),
    [
        ((0.1,), (), "one of each"),
        ((0.1,), (-2.0,), "must be positive"),
        ((float("nan"),), (2.0,), "finite"),
    ],
)
def test_sections_that_make_no_sense_are_refused(
    gains: tuple[float, ...], time_constants: tuple[float, ...], names: str
) -> None:
    with pytest.raises(InputError, match=names):
        CreepModel(gains, time_constants)
