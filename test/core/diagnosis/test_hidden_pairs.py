"""Of two effects that hide each other, what stands for both may be the best alone.

And which of them comes first the record tells.
"""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import (
    Candidate,
    CandidateFitter,
    FittedCandidates,
    InitialFit,
)
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.search import ModelSearch
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array

BOTH = ("extra_resonance", "rate_dependent_hysteresis")
INSTEAD = ("parameter_shift", "delay")
LEFT = {
    (): 1000.0,
    INSTEAD[:1]: 300.0,
    INSTEAD: 100.0,
    BOTH[:1]: 500.0,
    BOTH[1:]: 600.0,
}
"""Misfit that is left with some effects, or with more than these."""


def left(names: Iterable[str], both: float) -> float:
    known = set(names)
    table = {**LEFT, BOTH: both}
    return min(misfit for needed, misfit in table.items() if known.issuperset(needed))


@frozen(eq=False)
class Guess(FittedCandidates):
    """A trial of which the chain is the names of what is in it."""

    def extended(self, _: Chain) -> Chain:
        return cast("Chain", self.names)

    def without(self, _: Chain, place: int) -> Chain:
        return cast("Chain", (*self.names[:place], *self.names[place + 1 :]))


class Left:
    """A record of one band."""

    limit = SimpleNamespace(rms=np.ones(1))

    def __init__(self, both: float) -> None:
        self._both = both

    def ratio(self, names: Iterable[str]) -> Array:
        """Rms over the floor, which counts 1; (1,)."""
        return np.sqrt([left(names, self._both)])


class Foretold(CandidateFitter):
    """A bench on which a trial leaves what is foretold; one form of each effect is tried."""

    def __init__(self, both: float) -> None:
        super().__init__((cast("Any", Left(both)),), cast("Chain", ()))
        self._both = both

    def left(self, names: Iterable[str]) -> float:
        """Misfit with some effects."""
        return left(names, self._both)

    def misfit(self, chain: Chain) -> float:
        return self.left(cast("Iterable[str]", chain))

    def begin(
        self, selected: FittedCandidates | None, candidate: Candidate, _: ResidualFeatures
    ) -> InitialFit | None:
        if candidate.form is not candidate.effect.forms[0]:
            return None
        candidates = (*(selected.candidates if selected else ()), candidate)
        count = sum(len(c.form.parameters) for c in candidates)
        cost = self.left([c.effect.name for c in candidates])
        return InitialFit(candidates, np.full((1, count), 2.0), cost)

    def with_form(
        self, _: FittedCandidates, __: int, ___: EffectForm, ____: ResidualFeatures
    ) -> None:
        return None

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> FittedCandidates:
        misfit = self.left([c.effect.name for c in candidates])
        return Guess(candidates, Fit(rows, np.zeros(rows.shape[1]), misfit), misfit)


class InOrder(Foretold):
    """A bench on which the pair leaves more where one of it comes first."""

    def __init__(self, worse: str) -> None:
        super().__init__(10.0)
        self._worse = worse

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> FittedCandidates:
        found = super()._fitted(candidates, rows)
        first = candidates[0].effect.name == self._worse and len(candidates) > 1
        return evolve(found, misfit=found.misfit + first)


class Open(Foretold):
    """A bench on which the record leaves open how much there is of the best."""

    def left(self, names: Iterable[str]) -> float:
        """Misfit with some effects."""
        known = set(names)
        if "hysteretic_stiffness" in known:
            return 10.0
        return 10.0 + self._both if "parameter_shift" in known else 300.0

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> FittedCandidates:
        found = super()._fitted(candidates, rows)
        if candidates[-1].effect.name != "hysteretic_stiffness":
            return found
        halfwidth = np.full(rows.shape[1], np.inf)
        return evolve(found, fit=evolve(found.fit, halfwidth=halfwidth))


APART = {"drift": 90.0, "delay": 6.0}
"""Rms over the floor of two bands, of which one effect explains the one."""


class Bands:
    """A record of these two bands."""

    limit = SimpleNamespace(rms=np.ones(len(APART)))

    @staticmethod
    def ratio(names: Iterable[str]) -> Array:
        """Rms over the floor, which counts 1; (2,)."""
        known = set(names)
        return np.array([1.0 if name in known else rms for name, rms in APART.items()])


class Apart(Foretold):
    """A bench on which a drift explains the slow band, and a delay one that is far fainter."""

    def __init__(self) -> None:
        super().__init__(0.0)
        self.evidence = (cast("Any", Bands()),)

    def left(self, names: Iterable[str]) -> float:
        """Misfit with some effects."""
        return float(np.sum(Bands.ratio(names) ** 2))


def test_a_large_effect_hides_none_that_acts_in_other_bands() -> None:
    features = cast("ResidualFeatures", None)
    found = ModelSearch(Apart(), lambda _: features, lambda _: None).select()
    assert found.selected is not None
    assert set(found.selected.names) == {"drift", "delay"}


@pytest.mark.parametrize(
    ("more", "expected"), [(0.5, ("parameter_shift",)), (20.0, None)], ids=["as good", "worse"]
)
def test_what_is_certain_stands_for_what_is_not_where_it_does_as_well(
    more: float, expected: tuple[str] | None
) -> None:
    features = cast("ResidualFeatures", None)
    found = ModelSearch(Open(more), lambda _: features, lambda _: None).select()
    assert (found.selected.names if found.selected else None) == expected


@pytest.mark.parametrize("worse", BOTH)
def test_effects_take_the_order_that_leaves_least(worse: str) -> None:
    features = cast("ResidualFeatures", None)
    found = ModelSearch(InOrder(worse), lambda _: features, lambda _: None).select()
    assert found.selected is not None
    assert set(found.selected.names) == set(BOTH)
    assert found.selected.names[1] == worse


@pytest.mark.parametrize(
    ("both", "expected"),
    [(10.0, BOTH), (200.0, INSTEAD)],
    ids=["the pair leaves least", "the pair leaves more"],
)
def test_pairs_beside_the_next_best_alone_are_tried(both: float, expected: tuple[str, str]) -> None:
    features = cast("ResidualFeatures", None)
    found = ModelSearch(Foretold(both), lambda _: features, lambda _: None).select()
    assert found.selected is not None
    assert set(found.selected.names) == set(expected)
