"""Duhem's operator: golden models of two papers, and the laws of any operator and its inverse."""

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from afm_scan_ros.core.effects.hysteresis.duhem import Duhem
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import InputError

CELLS, WIDTH, LIMIT = paper.CELLS, paper.WIDTH, paper.LIMIT
RATE, SLOPE, INNER = paper.RATE, paper.SLOPE, paper.INNER
SLOPES = paper.coleman_hodgdon()
EFFECT = Duhem(SLOPES)
ROUNDING = 1e-12


def fading(turns: int = 40, per_turn: int = 400) -> np.ndarray:
    sizes = LIMIT * np.linspace(1.0, 0.05, turns) * np.resize([1.0, -1.0], turns)
    return np.interp(np.arange(turns * per_turn) / per_turn, np.arange(turns + 1), [0.0, *sizes])


def test_coleman_and_hodgdons_equation_is_followed() -> None:
    """Their Eq. 2.3 solves it on each branch."""
    drive, f, last, expected = fading(), 0.0, 0.0, []
    for u in drive:
        way = np.sign(u - last)
        lag = way * (SLOPE - INNER) / RATE
        f = SLOPE * u - lag + (f - SLOPE * last + lag) * np.exp(-RATE * abs(u - last))
        last = u
        expected.append(f)
    found = EFFECT.apply(EFFECT.at_rest(), drive)[1]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_any_slopes_are_followed_as_a_general_solver_does() -> None:
    """Slopes that bend in both directions, between stops of the lattice."""
    rng = np.random.default_rng(3)
    rough = [table + 0.05 * rng.standard_normal(table.shape) for table in (SLOPES.rising,) * 2]
    slopes = evolve(SLOPES, rising=rough[0], falling=rough[1][:, ::-1])
    effect = Duhem(slopes)
    ends, output = (-3.1, 2.7, 0.4), slopes.rest
    for start, end in zip((0.0, *ends), ends, strict=False):
        table = slopes.rising if end > start else slopes.falling

        def slope(u: float, f: np.ndarray, table: np.ndarray = table) -> list[float]:
            along, across = (
                _spline(CELLS, (u + LIMIT) / (2.0 * LIMIT)),
                _spline(CELLS, (f[0] - slopes.height(u) + WIDTH) / (2.0 * WIDTH)),
            )
            return [float(along @ table @ across)]

        output = solve_ivp(slope, (start, end), [output], rtol=1e-10, atol=1e-12).y[0, -1]
    found = effect.apply(effect.at_rest(), np.array(ends))[1][-1]
    assert found == pytest.approx(output, abs=1e-5)


def _spline(cells: int, share: float) -> np.ndarray:
    """All B-splines of uniform cells at a share of them, by their definition."""
    place = np.clip(share, 0.0, 1.0) * cells
    apart = np.abs(place - (np.arange(cells + 3) - 1.0))
    near = (4.0 - 6.0 * apart**2 + 3.0 * apart**3) / 6.0
    return np.where(apart < 1.0, near, np.clip(2.0 - apart, 0.0, None) ** 3 / 6.0)


seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=30)
@given(seed=seeds, size=st.floats(0.01, 1.0))
def test_the_inverse_gives_every_input_back(seed: int, size: float) -> None:
    drive = np.random.default_rng(seed).uniform(-size * LIMIT, size * LIMIT, 300)
    outputs = EFFECT.apply(EFFECT.at_rest(), drive)[1]
    back = EFFECT.invert(EFFECT.inverse_at_rest(), outputs)[1]
    np.testing.assert_allclose(back, drive, atol=ROUNDING * LIMIT)


@settings(deadline=None, max_examples=30)
@given(seed=seeds, cut=st.lists(st.integers(0, 300), max_size=5))
def test_blocks_change_no_bit(seed: int, cut: list[int]) -> None:
    drive = np.random.default_rng(seed).uniform(-2.0, 2.0, 300)
    for step in (EFFECT.apply, EFFECT.invert):
        state, parts = EFFECT.at_rest(), []
        for block in np.split(drive, sorted(cut)):
            state, part = step(state, block)
            parts.append(part)
        end, whole = step(EFFECT.at_rest(), drive)
        assert np.array_equal(np.concatenate(parts), whole)
        assert np.array_equal(state, end)


def test_more_samples_on_the_way_change_nothing() -> None:
    ends = np.array([0.0, 3.7, -2.2, 1.0])
    dense = np.interp(np.linspace(0.0, 3.0, 3001), np.arange(4.0), ends)
    few, many = (EFFECT.apply(EFFECT.at_rest(), drive)[1][-1] for drive in (ends, dense))
    assert many == pytest.approx(few, abs=1e-6)


def test_a_share_of_the_memory_moves_the_output_from_the_centre() -> None:
    drive, half = fading(), Duhem(SLOPES.with_share(0.5))
    whole = EFFECT.apply(EFFECT.at_rest(), drive)[1] - drive
    found = half.apply(half.at_rest(), drive)[1] - drive
    np.testing.assert_allclose(found, 0.5 * whole, atol=1e-9)
    none = Duhem(SLOPES.with_share(0.0))
    np.testing.assert_allclose(none.apply(none.at_rest(), drive)[1], drive, atol=1e-9)
    with pytest.raises(InputError, match="not positive"):
        SLOPES.with_share(3.0)


def test_the_chord_is_the_slope_from_end_to_end() -> None:
    assert SLOPES.chord == pytest.approx(SLOPE)


@pytest.mark.parametrize("value", [3.9, -3.9, np.nan])
def test_outputs_that_need_inputs_beyond_the_range_are_refused(value: float) -> None:
    with pytest.raises(BeyondRangeError) as caught:
        EFFECT.invert(EFFECT.inverse_at_rest(), np.array([0.0, 1.0, value]))
    assert caught.value.sample == 2


@pytest.mark.parametrize("value", [4.1, -4.1, np.nan])
def test_inputs_beyond_the_range_are_refused(value: float) -> None:
    with pytest.raises(BeyondRangeError) as caught:
        EFFECT.apply(EFFECT.at_rest(), np.array([0.0, value]))
    assert caught.value.sample == 1


def test_slopes_without_an_inverse_are_refused() -> None:
    bad = SLOPES.rising.copy()
    bad[5, 5] = 0.0
    with pytest.raises(InputError, match=r"rising slope .* u = -1\.333 V"):
        evolve(SLOPES, rising=bad)
    with pytest.raises(InputError, match="falling slope"):
        evolve(SLOPES, falling=-SLOPES.falling)


@pytest.mark.parametrize(
    "change",
    [
        {"falling": SLOPES.falling[1:]},
        {"centre": SLOPES.centre[1:]},
        {"widths": (0.5, 0.5)},
        {"upper": -5.0},
        {"rest": np.nan},
    ],
)
def test_slopes_that_do_not_fit_together_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError, match="Duhem"):
        evolve(SLOPES, **change)
