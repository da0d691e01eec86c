"""Decision rules of the diagnosis of coupled axes, on made-up likelihoods."""

from typing import cast

import numpy as np
import pytest
from attrs import evolve, frozen

from afm_scan_ros.core.coupled_scanner import CoupledScanner, LevelError
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND, SUFFICIENT, UNEXPLAINED
from afm_scan_ros.core.diagnosis.coupled.diagnosis import verdict_of
from afm_scan_ros.core.diagnosis.coupled.evidence import HeldOutLikelihood
from afm_scan_ros.core.diagnosis.coupled.search import (
    LOG_ODDS,
    CoupledSearch,
    FittedSet,
    SetPosterior,
    _extended,
)
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.search import Names
from afm_scan_ros.core.effects.effect_type import Actuators
from afm_scan_ros.core.effects.registry import COUPLED_EFFECTS
from afm_scan_ros.core.effects.static_nonlinearity import Powers
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.spectra import power_by_band
from afm_scan_ros.core.types import Array, Tally

SOFT, SLIP, SHIFT = ("amplitude_softening",), ("maxwell_slip",), ("parameter_shift",)
SAMPLES, PERIOD, PARTS = 256, 1e-3, 4
RNG = np.random.default_rng(3)


def trial(names: Names, nats: float, *, adequate: bool = True) -> FittedSet:
    """Trial of so many nats, prior odds included."""
    one = np.ones(1)
    bands = CellFit(one, one, one, one, nats - LOG_ODDS * len(names))
    return FittedSet(names, one, bands, adequate)


def posterior(*trials: FittedSet, outside: float = -1e3) -> SetPosterior:
    return SetPosterior({each.names: each for each in trials}, outside, ())


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (posterior(trial((), 0.0), trial(SOFT, -5.0)), SUFFICIENT),
        (posterior(trial((), 0.0), trial(SOFT, 5.0)), FOUND),
        (posterior(trial((), 0.0), trial(SOFT, 5.0), trial(SLIP, 4.0)), AMBIGUOUS),
        (posterior(trial((), 0.0), trial(SOFT, 5.0, adequate=False)), UNEXPLAINED),
        (posterior(trial((), 0.0, adequate=False), trial(SOFT, -5.0)), UNEXPLAINED),
        (posterior(trial((), 0.0), trial(SOFT, 5.0), outside=50.0), UNEXPLAINED),
        (posterior(trial((), -9.0), trial(SOFT, 2.0), trial((*SOFT, *SLIP), 1.9)), FOUND),
    ],
)
def test_the_verdict_follows_from_the_posterior(found: SetPosterior, verdict: str) -> None:
    assert verdict_of(found) == verdict


def test_an_effect_is_as_probable_as_all_its_sets() -> None:
    found = posterior(trial((), 0.0), trial(SOFT, 2.0), trial((*SOFT, *SLIP), 2.0))
    assert found.of_effect(SOFT[0]) == pytest.approx(2.0 * found.of_effect(SLIP[0]))
    assert set(found.credible(0.8)) == {SOFT, (*SOFT, *SLIP)}


def test_likely_sets_alone_are_extended() -> None:
    trials = {each.names: each for each in (trial((), 0.0), trial(SOFT, 9.0), trial(SHIFT, 4.3))}
    all_names = [effect.name for effect in COUPLED_EFFECTS]
    assert list(_extended(trials, 1, ())) == [(name,) for name in all_names]
    assert SOFT not in list(_extended(trials, 1, SOFT))
    pairs = list(_extended(trials, 2, ()))
    assert all(SOFT[0] in names for names in pairs)
    assert len(pairs) == len(set(pairs)) == len(all_names) - 1
    trials[SHIFT] = trial(SHIFT, 4.5)  # within a hundredth of the best
    assert any(SOFT[0] not in names for names in _extended(trials, 2, ()))


@frozen(eq=False)
class MadeUp:
    """Likelihood whose base leaves ten times its variance."""

    @property
    def base(self) -> Array:
        return np.zeros(1)

    def fit(self, simulated: Array, *, exact: bool = False) -> CellFit:  # noqa: ARG002
        one = np.ones(1)
        return CellFit(10.0 * one, one, 8.0 * one, 1.4 * one, -50.0)

    def explains(self, bands: CellFit) -> bool:
        return bands.unremarkable

    def outside(self) -> float:
        return -1e3


@pytest.mark.parametrize(("left", "pairs"), [(1.0, 0), (20.0, len(COUPLED_EFFECTS) - 1)])
def test_pairs_are_tried_only_beside_a_set_that_leaves_something(left: float, pairs: int) -> None:
    search, tried = object.__new__(CoupledSearch), []
    one = np.ones(1)

    def made(names: Names) -> FittedSet:
        tried.append(names)
        nats = 50.0 if names == SOFT else 0.0
        return FittedSet(
            names, one, CellFit(left * one, one, 8.0 * one, 1.4 * one, nats), left == 1.0
        )

    search.likelihood = cast("HeldOutLikelihood", MadeUp())
    search.__dict__.update(_has=(), _tally=Tally(lambda _: None), _trial=made)
    assert search.run().likeliest == SOFT
    assert sum(len(names) == 2 for names in tried) == pairs


def likelihood(error: float = 0.05) -> HeldOutLikelihood:
    """Two axes that follow their drives at once, of a stated error; two records of noise."""
    two, none = np.eye(2), np.zeros((2, 0))
    scanner = CoupledScanner(
        ("a", "b"),
        StateSpaceModel(np.zeros((0, 0)), none.T, none, two, PERIOD),
        (1.0, 499.0),
        (),
        Actuators(np.ones(2), two, 0.05, PERIOD),
        9.0,
        (LevelError(1.0, error, 1.0, PARTS * (error,)),),
    )
    drive = RNG.standard_normal((SAMPLES, 2, 2))
    healthy = np.zeros(2, dtype=bool)
    return HeldOutLikelihood(scanner, drive, drive, np.zeros((PARTS, 2, 2)), healthy)


def test_the_stated_error_is_the_limit() -> None:
    made = likelihood(0.05)
    moved = np.sqrt(np.mean((made.output - made.output.mean(axis=0)) ** 2, axis=(0, 2)))
    np.testing.assert_allclose(made.limits(), 0.05 * moved, rtol=1e-9)


@pytest.mark.parametrize(("ratio", "explained"), [(0.1, True), (1.0, True), (2.2, False)])
def test_all_cells_together_may_lack_what_none_does(*, ratio: float, explained: bool) -> None:
    """Each cell alone is unremarkable at 2.2 times its variance, known from 25 amplitudes."""
    made = likelihood()
    count = np.full(PARTS * 4, made.amplitudes)
    bands = CellFit(ratio * made.variance, made.variance, count, count, 0.0)
    assert bands.adequate
    assert made.explains(bands) is explained


def test_a_healthy_record_does_not_hide_what_another_leaves() -> None:
    made = evolve(likelihood(), healthy=np.array([True, False]))
    count = np.full(PARTS * 4, made.amplitudes)
    ratio = np.broadcast_to([0.0, 2.2], (PARTS, 2, 2)).ravel()
    assert not made.explains(CellFit(ratio * made.variance, made.variance, count, count, 0.0))


def test_one_cell_may_lack_what_the_others_do_not() -> None:
    made = likelihood()
    count = np.full(PARTS * 4, made.amplitudes)
    power = made.variance.copy()
    power[5] *= 1e4
    assert not made.explains(CellFit(power, made.variance, count, count, 0.0))


def test_outside_is_likelier_than_a_model_that_leaves_much() -> None:
    made = likelihood()
    close, far = (made.fit(share * made.output) for share in (0.97, 0.5))
    most = made.fit(np.zeros_like(made.output)).power
    assert close.outside(most) < close.log_likelihood
    assert far.outside(most) > far.log_likelihood


def test_parts_of_a_band_hold_all_power() -> None:
    signal = RNG.standard_normal((SAMPLES, 3, 2))
    power = power_by_band(signal, (50.0, 400.0), PARTS, PERIOD)
    np.testing.assert_allclose(power.sum(axis=0), signal.var(axis=0), rtol=0.05)
    wave = np.sin(2.0 * np.pi * 100.0 * PERIOD * np.arange(250))[:, np.newaxis]
    np.testing.assert_allclose(
        power_by_band(wave, (50.0, 400.0), PARTS, PERIOD)[:, 0], [0.5, 0.0, 0.0, 0.0], atol=1e-12
    )


def test_powers_grow_with_the_square_and_the_cube() -> None:
    element = Powers(Actuators(np.ones(2), np.eye(2), 0.1, PERIOD))
    drive, output = RNG.standard_normal((2, SAMPLES, 2))
    once, twice = (element.added(k * drive, k * output, SAMPLES) for k in (1.0, 2.0))
    np.testing.assert_allclose(twice[:, :4], 4.0 * once[:, :4])
    np.testing.assert_allclose(twice[:, 4:], 8.0 * once[:, 4:])
