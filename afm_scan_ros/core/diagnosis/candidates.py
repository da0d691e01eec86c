"""Fits candidate effects on one axis.

Candidates are fitted to one half of the stretches and scored on the other, each stretch about its
mean. Selected effects are then refitted to all samples, from the scanner's rest on, because the
desired displacement is zero there. Only these refitted values enter the model.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.decimation import decimated
from afm_scan_ros.core.diagnosis.evidence import Evidence, misfit
from afm_scan_ros.core.diagnosis.fit import Fit, Problem, inserted
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectType
from afm_scan_ros.core.effects.registry import CATALOGUE
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Candidate:
    """A form of an effect of the catalogue."""

    effect: EffectType
    form: EffectForm


CANDIDATES = tuple(
    Candidate(effect, form) for effect in CATALOGUE for form in effect.forms if form.refines is None
)


@frozen(eq=False)
class FittedCandidates:
    """Candidates fitted together, and their misfit on the test stretches."""

    candidates: tuple[Candidate, ...]
    fit: Fit
    misfit: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(candidate.effect.name for candidate in self.candidates)

    def part(self, place: int) -> slice:
        """Where the parameters of one of the candidates stand among those of all."""
        first = sum(len(c.form.parameters) for c in self.candidates[:place])
        return slice(first, first + len(self.candidates[place].form.parameters))

    def extended(self, chain: Chain) -> Chain:
        """Chain with the candidates at the fitted values."""
        return inserted(chain, [c.form for c in self.candidates], self.fit.rows)

    def without(self, chain: Chain, place: int) -> Chain:
        """Chain with all candidates but one, at the values of the joint fit."""
        forms = [c.form for i, c in enumerate(self.candidates) if i != place]
        return inserted(chain, forms, np.delete(self.fit.rows, self.part(place), axis=1))


@frozen(eq=False)
class InitialFit:
    """Candidates before they are fitted: values (r, p) to fit from, and the cost of these."""

    candidates: tuple[Candidate, ...]
    rows: Array
    cost: float


class CandidateFitter:
    """Fits candidates to the records of one axis, each inserted into a chain.

    Starting values come from ``decimated_evidence``. Fits and scores use the full records.
    """

    def __init__(self, evidence: Sequence[Evidence], chain: Chain) -> None:
        self.evidence = evidence
        self.chain = chain
        self._own: tuple[FittedCandidates | None, tuple[Array, ...]] = None, ()

    @cached_property
    def decimated_evidence(self) -> tuple[Evidence, ...]:
        """The records at the lowest sample rate that still determines starting values."""
        return tuple(decimated(each, self.chain) for each in self.evidence)

    def begin(
        self, selected: FittedCandidates | None, candidate: Candidate, features: ResidualFeatures
    ) -> InitialFit | None:
        """Find starting values of a candidate beside those selected; None where inapplicable.

        Coupling cannot be applied where the other axis is absent.
        """
        if self._alone and "coupling" in candidate.form.places:
            return None
        candidates = (*(selected.candidates if selected else ()), candidate)
        before = selected.fit.rows if selected else np.empty((len(self.evidence), 0))
        equivalent = (np.tile(s, (len(before), 1)) for s in candidate.form.starts(features))
        starts = (np.hstack((before, start)) for start in equivalent)
        found = self._decimated_problem(candidates).begin(
            starts, self._selected_influence(selected)
        )
        return InitialFit(candidates, *found) if found else None

    def fit(self, beginning: InitialFit) -> FittedCandidates | None:
        """Fit from starting values; None where the forms cannot be applied on the way."""
        return self._fitted(beginning.candidates, beginning.rows)

    def without(self, selected: FittedCandidates, place: int) -> FittedCandidates | None:
        """Fit the selected candidates without one; None where none remains."""
        rest = tuple(c for i, c in enumerate(selected.candidates) if i != place)
        rows = np.delete(selected.fit.rows, selected.part(place), axis=1)
        return self._fitted(rest, rows) if rest else None

    def with_form(
        self, selected: FittedCandidates, place: int, form: EffectForm, features: ResidualFeatures
    ) -> FittedCandidates | None:
        """Fit with another form of one candidate; None where it cannot be applied."""
        owner, part, rows = selected.candidates[place], selected.part(place), selected.fit.rows
        begun = (np.tile(start, (len(rows), 1)) for start in form.starts(features))
        starts = (np.hstack((rows[:, : part.start], b, rows[:, part.stop :])) for b in begun)
        before, after = selected.candidates[:place], selected.candidates[place + 1 :]
        candidates = (*before, Candidate(owner.effect, form), *after)
        found = self._decimated_problem(candidates).begin(starts)
        return self._fitted(candidates, found[0]) if found else None

    def related_forms(self, selected: FittedCandidates, place: int) -> Iterator[FittedCandidates]:
        """Fit the effect in a place in its other forms with the same parameters, from its values.

        A mass that shows as an additional mode has often moved a resonance too.
        """
        before, after = selected.candidates[:place], selected.candidates[place + 1 :]
        candidate = selected.candidates[place]
        for form in candidate.effect.forms:
            if form is not candidate.form and _names(form) == _names(candidate.form):
                candidates = (*before, Candidate(candidate.effect, form), *after)
                if trial := self._fitted(candidates, selected.fit.rows):
                    yield trial

    def reordered(self, selected: FittedCandidates) -> Iterator[FittedCandidates]:
        """Fit the selected candidates with the last one moved before each of the others.

        Order matters: an effect acts on the chain with the effects inserted before it.
        """
        *others, last = selected.candidates
        *values, of_last = np.split(selected.fit.rows, self._ends(selected), axis=1)
        for place in range(len(others)):
            candidates = (*others[:place], last, *others[place:])
            rows = np.hstack((*values[:place], of_last, *values[place:]))
            if trial := self._fitted(candidates, rows):
                yield trial

    def misfit(self, chain: Chain) -> float:
        """Misfit of a chain on the test stretches."""
        return misfit(self.evidence, chain, fitted=False)

    @cached_property
    def _alone(self) -> bool:
        """Whether no record has the other axis."""
        return not any(each.playback.view.other.any() for each in self.evidence)

    @staticmethod
    def _ends(selected: FittedCandidates) -> list[int]:
        """Where the values of each candidate but the last end."""
        return [selected.part(place).stop for place in range(len(selected.candidates) - 1)]

    def _selected_influence(self, selected: FittedCandidates | None) -> tuple[Array, ...]:
        """Influence of the selected candidates, computed once for all candidates beside them."""
        if selected and self._own[0] is not selected:
            self._own = (
                selected,
                self._decimated_problem(selected.candidates).influence_of_selected(
                    selected.fit.rows
                ),
            )
        return self._own[1] if selected else ()

    def _decimated_problem(self, candidates: Sequence[Candidate]) -> Problem:
        return Problem(self.decimated_evidence, self.chain, [c.form for c in candidates])

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> FittedCandidates | None:
        forms = [candidate.form for candidate in candidates]
        found = Problem(self.evidence, self.chain, forms).descend(rows)
        if found is None:
            return None
        chain = inserted(self.chain, forms, found.rows)
        return FittedCandidates(candidates, found, self.misfit(chain))


def _names(form: EffectForm) -> tuple[str, ...]:
    return tuple(parameter.name for parameter in form.parameters)


def refit_on_all(
    evidence: Sequence[Evidence], chain: Chain, selected: FittedCandidates
) -> FittedCandidates:
    """Return the candidates refitted to all samples; unchanged where that fit fails."""
    forms = [candidate.form for candidate in selected.candidates]
    found = Problem(evidence, chain, forms, Evidence.whole).descend(selected.fit.rows)
    return evolve(selected, fit=found) if found else selected
