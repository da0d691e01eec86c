"""The search over sets of effects: pairs that hide each other, orders, and when it ends."""

from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import (
    Candidate,
    CandidateFitter,
    FittedCandidates,
    InitialFit,
)
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.search import ModelSearch, Selection
from afm_scan_ros.core.diagnosis.settings import VARIANCE
from afm_scan_ros.core.diagnosis.variance import log_density
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array, Tally

BOTH = ("extra_resonance", "rate_dependent_hysteresis")
INSTEAD = ("parameter_shift", "delay")
BANDS = 6
Left = Mapping[tuple[str, ...], float]
"""Rms of every band over the healthy one, with some effects or more than these."""


def fit(names: Iterable[str], left: Left) -> CellFit:
    present = set(names)
    rms = min(value for needed, value in left.items() if present.issuperset(needed))
    cells = np.outer((rms**2, 1.0, VARIANCE.known, VARIANCE.freedom), np.ones(BANDS))
    return CellFit(*cells, float(np.sum(log_density(*cells))))


@frozen(eq=False)
class Guess(FittedCandidates):
    """A trial of which the chain is the names of what is in it."""

    def extended(self, _: Chain) -> Chain:
        return cast("Chain", self.names)

    def without(self, _: Chain, place: int) -> Chain:
        return cast("Chain", (*self.names[:place], *self.names[place + 1 :]))


class Foretold(CandidateFitter):
    """A fitter whose trials leave what is foretold; one form of each effect is tried."""

    def __init__(self, left: Left, worse: str = "") -> None:
        super().__init__((), cast("Chain", ()))
        self._left, self._worse = left, worse
        given = {"fit": lambda chain: fit(chain, left), "outside": lambda: -np.inf}
        self.likelihood = cast("Any", SimpleNamespace(**given, counts=np.ones(BANDS)))

    @property
    def without(self) -> FittedCandidates:  # type: ignore[override]
        return self._fitted((), np.empty((1, 0)))

    def begin(
        self, selected: FittedCandidates | None, candidate: Candidate, _: ResidualFeatures
    ) -> InitialFit | None:
        if candidate.form is not candidate.effect.forms[0]:
            return None
        candidates = (*(selected.candidates if selected else ()), candidate)
        cost = -fit([c.effect.name for c in candidates], self._left).log_likelihood
        return InitialFit(candidates, np.ones((1, 1)), cost)

    def with_form(
        self, _: FittedCandidates, __: int, ___: EffectForm, ____: ResidualFeatures
    ) -> None:
        return None

    def reordered(self, selected: FittedCandidates) -> Iterable[FittedCandidates]:
        yield self._fitted(selected.candidates[::-1], np.ones((1, 1)))

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> FittedCandidates:
        names = [c.effect.name for c in candidates]
        wrong = float(len(names) > 1 and names[0] == self._worse)
        found = Fit(rows, np.zeros(1), log_volume=-3.0 * len(names) - wrong)
        return Guess(candidates, found, fit(names, self._left))


def selected(fitter: CandidateFitter) -> Selection:
    features = ResidualFeatures(1.0, *4 * (np.zeros(2),), ())
    return ModelSearch(fitter, lambda _: features, Tally(lambda _: None)).select()


def names(found: Selection) -> set[str]:
    return set(found.selected.names) if found.selected else set()


LEFT = {(): 1000.0, INSTEAD[:1]: 300.0, INSTEAD: 100.0, BOTH[:1]: 500.0, BOTH[1:]: 600.0}


@pytest.mark.parametrize(("both", "expected"), [(1.0, BOTH), (200.0, INSTEAD)])
def test_pairs_beside_the_next_best_alone_are_tried(both: float, expected: tuple[str, str]) -> None:
    """What stands for both may be the best alone."""
    assert names(selected(Foretold({**LEFT, BOTH: both}))) == set(expected)


@pytest.mark.parametrize("worse", BOTH)
def test_effects_take_the_order_that_fits_best(worse: str) -> None:
    found = selected(Foretold({(): 1000.0, BOTH[:1]: 300.0, BOTH: 1.0}, worse))
    assert found.selected is not None
    assert found.selected.names[1] == worse


def test_two_effects_that_explain_nothing_alone_are_found() -> None:
    assert names(selected(Foretold({(): 100.0, BOTH: 1.0}))) in (set(), set(BOTH))


def test_a_residual_as_of_a_healthy_scanner_is_not_searched() -> None:
    found = selected(Foretold({(): 1.0, ("delay",): 0.01}))
    assert found.trials == ()
    assert found.posterior.probability == {(): 1.0}


def test_a_second_effect_needs_evidence_of_its_own() -> None:
    found = selected(Foretold({(): 100.0, ("delay",): 1.0, ("delay", "drift"): 0.9}))
    assert names(found) == {"delay"}
    assert all(len(trial.names) == 1 for trial in found.trials)


def test_effects_that_fit_alike_are_equally_probable() -> None:
    found = selected(Foretold({(): 100.0, ("delay",): 1.0, ("input_lag",): 1.0}))
    assert found.posterior.of_effect("delay") == pytest.approx(
        found.posterior.of_effect("input_lag"), rel=0.5
    )
    assert len(found.posterior.credible(0.95)) == 2


def test_an_effect_comes_twice_only_with_frequencies_of_its_own() -> None:
    found = selected(Foretold({(): 1000.0, ("delay",): 500.0, ("extra_resonance",): 400.0}))
    sets = [trial.names for trial in found.trials]
    assert not any(names.count("delay") > 1 for names in sets)
    assert any(names.count("extra_resonance") > 1 for names in sets)
