"""Probabilities of sets of effects: forms are summed, and a set of forms counts once."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.candidates import LOG_ODDS, Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.search import OUTSIDE, Posterior
from afm_scan_ros.core.diagnosis.settings import POSTERIOR
from afm_scan_ros.core.effects.registry import effect_type
from helpers.posteriors import no_effect

NATS = st.floats(-50.0, 50.0)


def fit(nats: float) -> CellFit:
    return CellFit(np.ones(1), np.ones(1), np.full(1, 8.0), np.full(1, 1.4), nats)


def trial(nats: float, *forms: tuple[str, str]) -> FittedCandidates:
    """Trial whose posterior is so many nats."""
    candidates = tuple(Candidate(effect_type(n), effect_type(n).form(k)) for n, k in forms)
    prior = sum(LOG_ODDS - np.log(len(c.effect.forms)) for c in candidates)
    values = np.concatenate([c.form.example for c in candidates])
    found = Fit(values[np.newaxis], np.zeros(len(values)))
    return FittedCandidates(candidates, found, fit(nats - prior))


DELAY, LAG = ("delay", ""), ("input_lag", "")
DRIFT, LOGARITHMIC = ("drift", ""), ("drift", "logarithmic")


@given(none=NATS, delay=NATS, lag=NATS)
def test_probabilities_follow_from_the_evidence(none: float, delay: float, lag: float) -> None:
    found = Posterior.of(no_effect(fit(none)), [trial(delay, DELAY), trial(lag, LAG)])
    assert sum(found.probability.values()) == pytest.approx(1.0)
    assert found.log_odds(("delay",), ()) == pytest.approx(delay - none)
    assert list(found.probability.values()) == sorted(found.probability.values(), reverse=True)


def test_forms_of_an_effect_are_one_hypothesis() -> None:
    found = Posterior.of(no_effect(fit(0.0)), [trial(3.0, DRIFT), trial(3.0, LOGARITHMIC)])
    assert found.log_odds(("drift",), ()) == pytest.approx(3.0 + np.log(2.0))
    assert dict(found.kinds("drift")) == pytest.approx({"": 0.5, "logarithmic": 0.5})


def test_the_order_of_effects_is_no_hypothesis() -> None:
    found = Posterior.of(no_effect(fit(0.0)), [trial(3.0, DRIFT, DELAY), trial(2.0, DELAY, DRIFT)])
    assert found.log_odds(("delay", "drift"), ()) == pytest.approx(3.0)
    assert found.best["delay", "drift"].names == ("drift", "delay")


def test_an_effect_is_as_probable_as_all_sets_that_hold_it() -> None:
    trials = [trial(5.0, DELAY), trial(5.0, DELAY, DRIFT), trial(-30.0, LAG)]
    found = Posterior.of(no_effect(fit(-30.0)), trials)
    assert found.of_effect("delay") == pytest.approx(1.0)
    assert found.of_effect("drift") == pytest.approx(0.5)
    assert found.of_effect("input_lag") < 1e-9


def test_the_credible_set_is_the_smallest() -> None:
    trials = [trial(np.log(8.0), DELAY), trial(np.log(1.5), LAG), trial(np.log(0.1), DRIFT)]
    found = Posterior.of(no_effect(fit(np.log(0.4))), trials)
    assert found.credible(0.95) == (("delay",), ("input_lag",))


def test_something_outside_the_catalogue_is_as_frequent_as_one_of_its_effects() -> None:
    found = Posterior.of(no_effect(fit(0.0)), [trial(-2.0, DELAY)], outside=3.0 - LOG_ODDS)
    assert found.likeliest == OUTSIDE
    assert found.log_odds(OUTSIDE, ()) == pytest.approx(3.0)
    assert found.log_odds(OUTSIDE, ("delay",)) == pytest.approx(5.0)
    assert sum(found.probability.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(("gain", "expected"), [(2.7, "gain"), (3.3, "warmth")])
def test_a_simpler_form_stands_for_an_effect_where_it_is_nearly_as_probable(
    gain: float, expected: str
) -> None:
    """Of three numbers two may not be determined."""
    forms = [("parameter_shift", "warmth"), ("parameter_shift", "gain")]
    trials = [
        evolve(trial(nats, form), fit=Fit(np.ones((1, count)), np.ones(count)))
        for nats, form, count in zip((gain, 0.0), forms, (3, 1), strict=True)
    ]
    (best,) = Posterior.of(no_effect(fit(-9.0)), trials).best.values()
    assert best.candidates[0].form.kind == expected


@pytest.mark.parametrize(("relative", "chosen"), [(0.014, ("input_lag",)), (0.007, ("delay",))])
def test_a_set_of_a_hundredth_of_the_probability_that_lacks_nothing_is_preferred(
    relative: float, chosen: tuple[str]
) -> None:
    lacking = evolve(
        trial(0.0, DELAY), cells=evolve(trial(0.0, DELAY).cells, power=np.full(1, 1e6))
    )
    found = Posterior.of(no_effect(fit(-90.0)), [lacking, trial(float(np.log(relative)), LAG)])
    assert next(iter(found.logs)) == ("delay",)
    assert found.likeliest == chosen


@pytest.mark.parametrize(("relative", "kind"), [(0.014, "hum"), (0.007, "")])
def test_a_form_of_a_hundredth_of_the_probability_that_lacks_nothing_is_preferred(
    relative: float, kind: str
) -> None:
    """One tone stands for a hum only where the other harmonics are not missed."""
    lacking = trial(0.0, ("periodic_disturbance", ""))
    lacking = evolve(lacking, cells=evolve(lacking.cells, power=np.full(1, 1e6)))
    hum = trial(float(np.log(relative)), ("periodic_disturbance", "hum"))
    (best,) = Posterior.of(no_effect(fit(-90.0)), [lacking, hum]).best.values()
    assert best.candidates[0].form.kind == kind


STIFFNESS = ("hysteretic_stiffness", "")


@pytest.mark.parametrize(
    ("likelier", "threshold", "kept"),
    [(0.0, 1e-10, False), (2.9, 1e-10, False), (3.1, 1e-10, True), (0.0, 1e-7, True)],
)
def test_an_effect_that_is_a_simpler_one_at_an_end_of_its_range_is_no_rival(
    likelier: float, threshold: float, *, kept: bool
) -> None:
    """Plays of no width leave a softer spring, as a gain does; two numbers more gain 3 nats."""
    gain = evolve(trial(0.0, ("parameter_shift", "gain")), cells=fit(-20.0))
    yields = evolve(
        trial(0.0, STIFFNESS),
        cells=fit(likelier - 20.0),
        fit=Fit(np.array([[0.01, threshold, 0.5]]), np.array([1e-3, 1e-8, 0.1])),
    )
    found = Posterior.of(no_effect(fit(-90.0)), [gain, yields])
    assert (("hysteretic_stiffness",) in found.logs) is kept


@given(left=st.floats(1e-3, 1e3), counts=st.floats(1.0, 100.0))
def test_an_effect_that_tells_the_shape_beats_what_has_any(left: float, counts: float) -> None:
    """By half a logarithm of what it explains a coefficient; one that explains nothing by none."""
    whole = trial(0.0, DELAY)
    cells = evolve(whole.cells, power=np.full(1, left), variance=np.ones(1), freedom=np.ones(1))
    told = cells.shape_told(np.full(1, 1e3), counts)
    more = min(counts, POSTERIOR.shape) - 1.0
    assert told == pytest.approx(0.5 * more * np.log(1001.0 / (1.0 + left)))
    assert cells.shape_told(np.full(1, 0.5 * left), counts) == 0.0
    best = evolve(whole, cells=cells)
    nothing = no_effect(evolve(fit(0.0), power=np.full(1, 1e3)))
    odds = Posterior.of(nothing, [best], 0.0, counts).logs
    assert odds[OUTSIDE] - odds["delay",] == pytest.approx(LOG_ODDS - told - best.log_posterior)
