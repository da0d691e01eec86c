"""The reversible part of a hysteresis, its loops made smaller, and its loops that lag."""

from types import ModuleType

import numpy as np
import paper
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects import rate_dependent_hysteresis, viscous_plays
from afm_scan_ros.core.effects.hysteresis.everett import (
    BeyondRangeError,
    EverettSurface,
    reversible,
)
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.rate_dependent_hysteresis import RateDependentHysteresis
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.viscous_plays import ViscousPlays
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import HysteresisModel, InverseSettings

PERIOD = 5e-5
SURFACE = paper.axis().hysteresis.forward
EFFECT = Preisach(SURFACE)
drives = st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=40)
lags = st.floats(1e-6, 1.0)


def straight(inputs: np.ndarray) -> np.ndarray:
    return np.interp(inputs, SURFACE.levels, reversible(SURFACE))


@settings(deadline=None, max_examples=30)
@given(drive=drives, share=st.floats(0.0, 3.0))
def test_a_share_of_the_loops_is_a_share_of_what_is_not_reversible(
    drive: list[float], share: float
) -> None:
    inputs = np.array(drive)
    changed = Preisach(SURFACE.with_share(share))
    whole = EFFECT.apply(EFFECT.at_rest(), inputs)[1]
    found = changed.apply(changed.at_rest(), inputs)[1]
    expected = straight(inputs) + share * (whole - straight(inputs))
    assert found == pytest.approx(expected, abs=1e-11)


def test_what_has_no_loops_is_reversible() -> None:
    """Weights on the diagonal alone are relays that switch both ways at one input."""
    surface = paper.surface_of(np.diag([1.0, 2.0, 3.0, 2.0]), -4.0, 4.0, 5.5)
    assert reversible(surface) == pytest.approx(surface.offset + 2.0 * surface.values[:, 0])


def test_loops_turned_round_are_refused() -> None:
    with pytest.raises(InputError, match="no inverse"):
        SURFACE.with_share(-3.0)


@settings(deadline=None, max_examples=30)
@given(drive=drives, lag=lags)
def test_what_has_memory_sees_the_mean_of_a_lagging_drive(drive: list[float], lag: float) -> None:
    """Golden: the lag's exact mean over each hold, sample after sample."""
    inputs, a, end, means = np.array(drive), np.exp(-PERIOD / lag), 0.0, []
    for u in inputs:
        means.append(u + (end - u) * (1.0 - a) * lag / PERIOD)
        end = u + (end - u) * a
    late = np.array(means)
    loops = EFFECT.apply(EFFECT.at_rest(), late)[1] - straight(late)
    effect = RateDependentHysteresis(SURFACE, lag, PERIOD)
    found = effect.apply(effect.at_rest(), inputs)[1]
    assert found == pytest.approx(straight(inputs) + loops, abs=1e-9)


def test_loops_close_at_high_rates_and_open_at_low_ones() -> None:
    """Width of a loop of ±2 V in the middle, at a thousandth and a thousand times 1/τ."""
    lag, widths = 1e-2, []
    for period in (2e-2 * np.pi * 1e3 / 400, 2e-2 * np.pi * 1e-3 / 400):
        effect = RateDependentHysteresis(SURFACE, lag, period)
        cycle = 2.0 * np.sin(2.0 * np.pi * np.arange(1601) / 400)
        forced = effect.apply(effect.at_rest(), cycle)[1]
        widths.append(forced[1400] - forced[1200])
    full = EFFECT.apply(EFFECT.at_rest(), cycle)[1]
    assert widths[0] == pytest.approx(full[1400] - full[1200], rel=1e-2)
    assert abs(widths[1]) <= 1e-2 * abs(widths[0])


@settings(deadline=None, max_examples=15)
@given(lag=lags, drive=drives, seed=st.integers(0, 1000))
def test_the_inverse_is_exact(lag: float, drive: list[float], seed: int) -> None:
    """For drives that jump, but for rounding at the range's very limits."""
    effect = RateDependentHysteresis(SURFACE, lag, PERIOD)
    inputs = 0.999 * np.concatenate((drive, paper.smooth_target(seed, 300, 3.9)))
    forced = effect.apply(effect.at_rest(), inputs)[1]
    found = effect.invert(effect.inverse_at_rest(), forced)[1]
    assert np.abs(found - inputs).max() <= 1e-6


def test_targets_beyond_the_surface_are_refused_by_sample() -> None:
    effect = RateDependentHysteresis(SURFACE, 1e-3, PERIOD)
    with pytest.raises(BeyondRangeError, match="sample 1 of the block") as refused:
        effect.invert(effect.inverse_at_rest(), np.array([0.0, 9.0, 0.0]))
    reached = effect.apply(effect.at_rest(), np.array([0.0, SURFACE.upper]))[1]
    assert refused.value.limit == pytest.approx(reached[1], rel=1e-4)


def test_the_direct_inverse_does_not_know_rates() -> None:
    chain = (
        effect_type("rate_dependent_hysteresis").form("").insert(Chain(paper.axis()), np.ones(1))
    )
    direct = evolve(InverseSettings(), hysteresis_inverse="direct")
    with pytest.raises(InputError, match="choose exact"):
        chain.compensator(PERIOD, ["hysteresis"], direct)


def direct_of(surface: EverettSurface, levels: int) -> EverettSurface:
    """Surface from output to input, from the reversal curves of the inverse."""
    effect = Preisach(surface)
    outputs = np.linspace(surface.output_lower, surface.output_upper, levels)
    values = np.zeros((levels, levels))
    for i in range(levels):
        curve = effect.invert(effect.saturated(), np.append(outputs[i], outputs[:i][::-1]))[1]
        values[i, :i] = 0.5 * (curve[0] - curve[1:])[::-1]
    return EverettSurface(outputs[0], outputs[-1], values, surface.lower)


def direct_error(hysteresis: HysteresisModel, direct: EverettSurface) -> float:
    """Rms error (V) of effective inputs by a direct inverse."""
    model, inverse = Preisach(hysteresis.forward), Preisach(direct)
    targets = paper.smooth_target(4, 2000, 5.0)
    drive = inverse.apply(inverse.at_rest(), targets)[1]
    return float(np.std(model.apply(model.at_rest(), drive)[1] - targets))


def test_the_direct_inverse_stays_as_good_when_loops_get_weaker() -> None:
    """As it was within 5 %, for narrow loops of half the width; worse by 15 % if left alone."""
    weights = paper.cell_weights(21, seed=2001)
    narrow = paper.surface_of(0.05 * weights + np.diag(np.diag(weights)), -4.0, 4.0, 5.5)
    base = HysteresisModel(narrow, direct_of(narrow, 41))
    chain = Chain(evolve(paper.axis(), hysteresis=base))
    weaker = effect_type("parameter_shift").form("hysteresis").insert(chain, np.array([0.5]))
    own = direct_error(base, base.direct)
    assert direct_error(weaker.model.hysteresis, base.direct) >= 1.15 * own
    assert direct_error(weaker.model.hysteresis, weaker.model.hysteresis.direct) <= 1.05 * own


@pytest.mark.parametrize(("gain", "memory"), [(0.9, 1.0), (1.0, 1.3), (0.9, 1.3)])
def test_polarisation_changes_gain_and_memory(gain: float, memory: float) -> None:
    """F = k (R + m H): of both factors it is k times R and k m times H."""
    chain = Chain(paper.axis())
    shift = effect_type("parameter_shift")
    drive = 3.0 * np.sin(np.linspace(0.0, 12.0, 3000))
    both = shift.form("polarisation").insert(chain, np.array([gain, memory]))
    apart = shift.form("gain").insert(
        shift.form("hysteresis").insert(chain, np.array([memory])), np.array([gain])
    )
    models = [each.forward(PERIOD) for each in (both, apart, chain)]
    moved, expected, before = (model.apply(model.at_rest(), drive)[1] for model in models)
    np.testing.assert_allclose(moved, expected, rtol=1e-12)
    assert np.ptp(moved - before) > 0.02 * np.ptp(before)


def film(drive: np.ndarray, lag: float) -> np.ndarray:
    """What a film adds, by its equation: plays of the surface's own cells, in many small steps."""
    levels, falls = SURFACE.levels, 2.0 * SURFACE.values
    step, steps = levels[1] - levels[0], 200
    masses = falls[1:, :-1] - falls[:-1, :-1] - falls[1:, 1:] + falls[:-1, 1:]
    near = 0.5 * np.interp(
        np.arange(len(masses)), np.arange(1, len(masses)) - 0.5, np.diag(masses, -1)
    )
    added = np.zeros(len(drive))
    for k in range(len(masses)):
        # A cell's relays switch one after another while the block crosses it.
        steps_up = near if k == 0 else np.diag(masses, -k)
        nodes = SURFACE.lower + step * (0.5 * k + np.arange(len(steps_up) + 1))
        curve = np.concatenate(([0.0], np.cumsum(steps_up)))
        reach, p, q = step * (0.5 * k if k else 1.0 / 6.0), 0.0, 0.0
        p = q = np.clip(0.0, SURFACE.lower + reach, SURFACE.upper - reach)
        for n, u in enumerate(drive):
            places = []
            for _ in range(steps):
                beyond = (u - p) - np.clip(u - p, -reach, reach)
                p += beyond * (PERIOD / steps) / lag
                places.append(p)
            q = np.clip(q, u - reach, u + reach)
            added[n] += np.interp(np.mean(places), nodes, curve) - np.interp(q, nodes, curve)
    return added


def test_a_film_drags_each_play() -> None:
    """Golden: Euler's steps of a two-hundredth of the period, of which the error is 1 %."""
    drive = np.concatenate((np.linspace(0.0, 3.0, 8), np.linspace(3.0, -2.0, 8)))
    effect = ViscousPlays(SURFACE, 3.0 * PERIOD, PERIOD)
    found = effect.apply(effect.at_rest(), drive)[1] - EFFECT.apply(EFFECT.at_rest(), drive)[1]
    expected = film(drive, 3.0 * PERIOD)
    assert found == pytest.approx(expected, abs=1e-2 * np.abs(expected).max())


def test_at_rest_a_film_has_let_go() -> None:
    drive = np.concatenate((np.linspace(0.0, 3.0, 30), np.full(400, 3.0)))
    effect = ViscousPlays(SURFACE, 1e-3, PERIOD)
    found = effect.apply(effect.at_rest(), drive)[1]
    expected = EFFECT.apply(EFFECT.at_rest(), drive)[1]
    assert np.abs(found[:30] - expected[:30]).max() >= 1e-2
    assert found[-1] == pytest.approx(expected[-1], abs=1e-6)


def test_a_film_that_heat_helps_without_limit_is_viscous() -> None:
    """Golden: for pulls a millionth of the activation, the plain film's share of each."""
    drive, films = paper.smooth_target(1, 300, 3.9), []
    for activation in (1e5, np.inf):
        effect = ViscousPlays(SURFACE, 1e-3, PERIOD, activation)
        films.append(effect.apply(effect.at_rest(), drive)[1])
    assert films[0] == pytest.approx(films[1], abs=1e-5)
    assert np.abs(films[1] - EFFECT.apply(EFFECT.at_rest(), drive)[1]).max() >= 1e-2


@pytest.mark.parametrize("rate", [1.0, 30.0, 1000.0])
def test_blocks_that_heat_helps_stay_behind_by_the_logarithm_of_the_rate(rate: float) -> None:
    """Golden: drawn steadily, the first block is a ln(1 + v τ / a) behind its play at last."""
    lag, activation, period = 1e-3, 0.05, min(1e-3 / rate, 2e-5)
    effect = ViscousPlays(SURFACE, lag, period, activation)
    state, _ = effect.apply(effect.at_rest(), np.arange(0.0, 0.5, rate * period))
    late, free = state[1]
    expected = activation * np.log1p(rate * lag / activation) / (SURFACE.levels[1] - SURFACE.lower)
    assert free[0] - late[0] == pytest.approx(expected, rel=0.05)


@settings(deadline=None, max_examples=8)
@given(
    lag=lags,
    activation=st.one_of(st.just(np.inf), st.floats(1e-4, 4.0)),
    drive=drives,
    seed=st.integers(0, 1000),
)
def test_the_inverse_of_a_film_is_exact(
    lag: float, activation: float, drive: list[float], seed: int
) -> None:
    effect = ViscousPlays(SURFACE, lag, PERIOD, activation)
    inputs = 0.999 * np.concatenate((drive, paper.smooth_target(seed, 300, 3.9)))
    forced = effect.apply(effect.at_rest(), inputs)[1]
    found = effect.invert(effect.inverse_at_rest(), forced)[1]
    assert np.abs(found - inputs).max() <= 1e-6


def test_targets_beyond_a_film_are_refused_by_sample() -> None:
    effect = ViscousPlays(SURFACE, 1e-3, PERIOD)
    with pytest.raises(BeyondRangeError, match="sample 1 of the block") as refused:
        effect.invert(effect.inverse_at_rest(), np.array([0.0, 9.0, 0.0]))
    reached = effect.apply(effect.at_rest(), np.array([0.0, SURFACE.upper]))[1]
    assert refused.value.limit == pytest.approx(reached[1], rel=1e-4)


@pytest.mark.parametrize("module", [rate_dependent_hysteresis, viscous_plays])
def test_an_inverse_whose_steps_do_not_suffice_is_refused(
    module: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    effects = {
        rate_dependent_hysteresis: RateDependentHysteresis,
        viscous_plays: ViscousPlays,
    }
    effect, wanted = effects[module](SURFACE, 1e-4, PERIOD), np.array([0.1, 0.3, 0.5])
    effect.invert(effect.inverse_at_rest(), wanted)
    monkeypatch.setattr(module, "ROUNDS", 1)
    monkeypatch.setattr(module, "_invert", vars(module)["_invert"].py_func)
    with pytest.raises(ScanError, match=r"^sample 0 of the block: no drive was found"):
        effect.invert(effect.inverse_at_rest(), wanted)


@pytest.mark.parametrize("kind", ["preisach", "late", "viscous"])
def test_no_inverse_leaves_the_inputs_that_were_identified(kind: str) -> None:
    """Of a drive of one sign, although the surface holds the memory of the other."""
    surface = evolve(SURFACE, within=(0.0, SURFACE.upper))
    effect = {
        "preisach": lambda: Preisach(surface),
        "late": lambda: RateDependentHysteresis(surface, 1e-3, PERIOD),
        "viscous": lambda: ViscousPlays(surface, 1e-3, PERIOD),
    }[kind]()
    inputs = np.concatenate([np.linspace(0.0, 3.0, 60), np.linspace(3.0, 0.5, 60)])
    outputs = effect.apply(effect.at_rest(), inputs)[1]
    back = effect.invert(effect.inverse_at_rest(), outputs)[1]
    np.testing.assert_allclose(back, inputs, atol=1e-6)
    lower = np.append(outputs, np.linspace(outputs[-1], outputs[0] - 1.0, 60))
    with pytest.raises(BeyondRangeError):
        effect.invert(effect.inverse_at_rest(), lower)
