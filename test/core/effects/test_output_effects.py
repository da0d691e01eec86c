"""Backlash, nonlinearity, drift and disturbance as anyone would work them out by hand."""

import numpy as np
import paper
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects import base
from afm_scan_ros.core.effects.backlash import STEEPNESS, Backlash
from afm_scan_ros.core.effects.drift import Drift, settles
from afm_scan_ros.core.effects.periodic_disturbance import Disturbance, starts_of_comb
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.static_nonlinearity import REACH, StaticNonlinearity
from afm_scan_ros.core.errors import InputError, ScanError

targets = st.lists(st.floats(-1e-5, 1e-5), min_size=1, max_size=60)


def test_a_follower_moves_only_when_pushed() -> None:
    """Golden: by hand, for a play of 2 µm."""
    moved = 1e-6 * np.array([0.5, 1.5, 3.0, 2.0, 1.0, 0.5, -1.0, 0.9, 1.1])
    expected = 1e-6 * np.array([0.0, 0.5, 2.0, 2.0, 2.0, 1.5, 0.0, 0.0, 0.1])
    effect = Backlash(2e-6)
    assert effect.apply(effect.at_rest(), moved)[1] == pytest.approx(expected, abs=1e-18)


@settings(deadline=None, max_examples=50)
@given(width=st.floats(0.0, 5e-6), target=targets)
def test_the_inverse_crosses_the_play_but_for_a_hundredth(
    width: float, target: list[float]
) -> None:
    effect, wanted = Backlash(width), np.array(target)
    before = effect.invert(effect.inverse_at_rest(), wanted)[1]
    found = effect.apply(effect.at_rest(), before)[1]
    assert np.abs(found - wanted).max() <= width / STEEPNESS + 1e-18


@settings(deadline=None, max_examples=50)
@given(width=st.floats(0.0, 5e-6), crossing=st.integers(0, 40), seed=st.integers(0, 1000))
def test_a_slower_crossing_misses_no_more_than_its_target_moves_meanwhile(
    width: float, crossing: int, seed: int
) -> None:
    effect = Backlash(width, crossing)
    wanted = paper.smooth_target(seed, 1000, 1e-5)
    state, first = effect.invert(effect.inverse_at_rest(), wanted)
    before = np.concatenate((first, effect.finish(state)))
    found = effect.apply(effect.at_rest(), before)[1]
    windows = np.lib.stride_tricks.sliding_window_view(wanted, crossing + 1)
    moved = np.ptp(windows, axis=1).max()
    assert np.abs(found - wanted).max() <= width / STEEPNESS + moved + 1e-18


def test_a_slower_crossing_is_less_steep() -> None:
    """Golden: 1 µm while the target turns, at once and over ten samples."""
    target = 1e-5 * np.concatenate((np.linspace(0.0, 1.0, 50), np.linspace(0.98, 0.0, 49)))
    steepest = {}
    for crossing in (0, 10):
        effect = Backlash(1e-6, crossing)
        state, first = effect.invert(effect.inverse_at_rest(), target)
        lead = np.concatenate((first, effect.finish(state))) - target
        steepest[crossing] = np.abs(np.diff(lead[20:])).max()
        assert lead[30] == pytest.approx(5e-7)
        assert lead[-1] == pytest.approx(-5e-7)
    assert steepest[0] == pytest.approx(1e-6)
    assert steepest[10] == pytest.approx(1e-6 / 11)


def test_rounding_of_a_target_at_rest_crosses_no_play() -> None:
    effect = Backlash(1e-6)
    target = 1e-5 + np.tile([0.0, 2e-21], 50)
    found = effect.invert(effect.inverse_at_rest(), target)[1]
    assert np.ptp(found) <= 1e-18


coefficients = st.tuples(
    *(st.floats(-share, share) for share in (0.16, 0.16, 0.06, 0.06))  # of x at the reach
)


@settings(deadline=None, max_examples=50)
@given(shares=coefficients, seed=st.integers(0, 1000))
def test_the_inverse_of_a_nonlinearity_is_exact(shares: tuple[float, ...], seed: int) -> None:
    """Everywhere, beyond its reach too."""
    bent_by = np.array([0.0, 1.0, *shares]) / REACH ** np.array([0, 0, 1, 2, 3, 4])
    if (effect := rising(bent_by)) is None:
        return
    straight = np.random.default_rng(seed).uniform(-1.5 * REACH, 1.5 * REACH, 200)
    bent = effect.apply(effect.at_rest(), straight)[1]
    assert np.abs(effect.invert(None, bent)[1] - straight).max() <= 1e-13 * REACH


def test_an_inverse_that_was_not_reached_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    effect = StaticNonlinearity(np.array([0.0, 1.0, 1e4]))
    with pytest.raises(ScanError, match=r"^sample 1 of the block: static_nonlinearity"):
        effect.invert(None, np.array([0.0, np.nan]))
    monkeypatch.setattr(base, "NEWTON_STEPS", 0)
    with pytest.raises(ScanError, match=r"^sample 1 of the block: static_nonlinearity"):
        effect.invert(None, np.array([0.0, 1.001e-5]))


def rising(bent_by: np.ndarray) -> StaticNonlinearity | None:
    """Nonlinearity of these coefficients, if it has an inverse."""
    slope = np.polynomial.Polynomial(bent_by).deriv()(np.linspace(-REACH, REACH, 1000))
    return StaticNonlinearity(bent_by) if slope.min() > 0.05 else None


def test_a_nonlinearity_is_its_polynomial() -> None:
    """Golden: 10 µm, by hand: 1, 0.1, 0.01 and 0.001 % more."""
    effect = StaticNonlinearity(np.array([0.0, 1.0, 1e3, 1e7, 1e11, 1e15]))
    found = effect.apply(None, np.array([1e-5, -1e-5]))[1]
    assert found == pytest.approx([1.01111e-5, -0.99091e-5], rel=1e-12)


def test_a_displacement_that_would_turn_back_is_refused_where_it_does() -> None:
    with pytest.raises(InputError, match="turns back at -1 of its reach, 4e-05, so it has no inv"):
        StaticNonlinearity(np.array([0.0, 1.0, 1.3e4]))


def test_drift_begins_at_its_rate_and_ends_at_rest() -> None:
    effect = Drift(settles, 1e-8, 10.0, 0.1)
    moved = effect.apply(effect.at_rest(), np.zeros(2000))[1]
    assert moved[1] == pytest.approx(1e-9, rel=0.01)
    assert moved[-1] == pytest.approx(1e-7, rel=1e-6)


def test_a_drift_that_slows_down_moves_alike_in_every_decade() -> None:
    """Golden: 1 nm/s at first, then ln 10 of 10 nm from 100 settling times to 1000."""
    effect = Drift(np.log1p, 1e-9, 10.0, 0.1)
    moved = effect.apply(effect.at_rest(), np.zeros(100_001))[1]
    assert moved[1] == pytest.approx(1e-10, rel=0.01)
    assert moved[-1] - moved[10_000] == pytest.approx(1e-8 * np.log(10.0), rel=0.01)


def test_a_disturbance_counts_from_the_records_first_sample() -> None:
    """Golden: 3 and 4 nm at 50 Hz, a quarter period later the sine alone."""
    effect = Disturbance(np.array([3e-9 - 4e-9j]), 50.0, 5e-3)
    state, first = effect.apply(effect.at_rest(), np.zeros(1))
    _, second = effect.apply(state, np.full(1, 1e-6))
    assert first == pytest.approx([3e-9])
    assert second == pytest.approx([1.004e-6])
    assert np.array_equal(effect.invert(None, second)[1], second)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), teeth=st.integers(1, 24))
def test_a_comb_is_the_sum_of_its_tones(seed: int, teeth: int) -> None:
    random = np.random.default_rng(seed)
    harmonics, time = random.normal(size=(teeth, 2)) @ [1.0, -1j], 1e-3 * np.arange(50)
    effect = Disturbance(harmonics, 21.0, 1e-3)
    found = effect.apply(effect.at_rest(), np.zeros(50))[1]
    tones = (
        c.real * np.cos(p) - c.imag * np.sin(p)
        for c, p in zip(
            harmonics, 2.0 * np.pi * 21.0 * np.outer(range(1, teeth + 1), time), strict=True
        )
    )
    assert found == pytest.approx(sum(tones), abs=1e-9)


@settings(deadline=None, max_examples=20)
@example(loudest=5, rate=40.0, seed=0)  # of which the sample rate is a multiple
@given(
    loudest=st.integers(1, 6),
    rate=st.floats(15.0, 40.0),
    seed=st.integers(0, 1000),
)
def test_a_comb_is_begun_at_its_fundamental_whichever_tooth_is_loudest(
    loudest: int, rate: float, seed: int
) -> None:
    """Six teeth, one twice as high as the others, no two of which would do without the rest."""
    random, period = np.random.default_rng(seed), 1e-3
    sizes = np.where(np.arange(1, 7) == loudest, 2e-8, 1e-8)
    harmonics = sizes * np.exp(2j * np.pi * random.uniform(size=6))
    effect = Disturbance(harmonics, rate, period)
    residual = effect.apply(0, random.normal(0.0, 1e-10, 4000))[1]
    still = np.zeros(4000)
    features = ResidualFeatures(period, still, still, residual, still, (loudest * rate,))
    (start,) = starts_of_comb(6)(features)
    assert start[2] == pytest.approx(rate, rel=1e-3)
    assert start[:2] == pytest.approx((harmonics[0].real, -harmonics[0].imag), abs=2e-9)
