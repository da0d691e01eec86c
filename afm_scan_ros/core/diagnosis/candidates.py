"""Fits candidate effects on one axis, each inserted into its chain, to all data."""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence, decimated, repeating
from afm_scan_ros.core.diagnosis.fit import Fit, Problem, inserted
from afm_scan_ros.core.diagnosis.likelihood import CellFit, Likelihood
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType
from afm_scan_ros.core.effects.registry import CATALOGUE
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.scale import Scale, scale_of
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Candidate:
    """A form of an effect of the catalogue."""

    effect: EffectType
    form: EffectForm

    def at(self, scale: Scale) -> "Candidate":
        """Return the candidate for a scanner of another scale."""
        effect = self.effect.at(scale)
        return Candidate(effect, effect.form(self.form.kind))


LOG_ODDS = float(np.log(SEARCH.expected / len(CATALOGUE)))
CANDIDATES = tuple(
    Candidate(effect, form) for effect in CATALOGUE for form in effect.forms if form.refines is None
)


@frozen(eq=False)
class FittedCandidates:
    """Candidates fitted together, and what they leave in the cells of all records.

    The ``nuisance`` forms belong to every hypothesis, and their values come first.
    """

    candidates: tuple[Candidate, ...]
    fit: Fit
    cells: CellFit
    nuisance: tuple[EffectForm, ...] = ()

    @property
    def forms(self) -> tuple[EffectForm, ...]:
        """All forms, in the order in which they are inserted."""
        return (*self.nuisance, *(candidate.form for candidate in self.candidates))

    @property
    def log_posterior(self) -> float:
        """Log of prior times evidence, in nats, relative to other sets."""
        prior = sum(LOG_ODDS - np.log(len(candidate.effect.forms)) for candidate in self.candidates)
        return float(self.cells.log_likelihood + self.fit.log_volume + prior)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(candidate.effect.name for candidate in self.candidates)

    @property
    def at_end(self) -> bool:
        """Whether a value is at an end of its range, where the effect is not as the catalogue's."""
        return any(parameter.at_end(value, half) for parameter, value, half in self._numbers)

    @property
    def may_be_at_end(self) -> bool:
        """Whether the interval of a value holds an end of its range."""
        return any(not p.lower < v - half <= v + half < p.upper for p, v, half in self._numbers)

    @property
    def _numbers(self) -> Iterator[tuple[EffectParameter, float, float]]:
        """Parameters of the effects, their values and half their intervals."""
        each = [p for candidate in self.candidates for p in candidate.form.parameters]
        own = slice(len(self.fit.values) - len(each), None)
        return zip(each, self.fit.values[own], self.fit.halfwidth[own], strict=True)

    def part(self, place: int) -> slice:
        """Where the parameters of one of the candidates stand among those of all."""
        forms, at = self.forms, len(self.nuisance) + place
        first = sum(len(form.parameters) for form in forms[:at])
        return slice(first, first + len(forms[at].parameters))

    def extended(self, chain: Chain) -> Chain:
        """Chain with the candidates at the fitted values."""
        return inserted(chain, self.forms, self.fit.rows)

    def deviated(self, chain: Chain, share: float) -> Iterator[Chain]:
        """Yield the chain for a further record at a ``share`` of each deviation of the values.

        Values stay within their ranges: of both directions, the one with more room is taken.
        """
        forms, values = self.forms, self.fit.values
        each = [p for form in forms for p in form.parameters]
        lower, upper = (np.array([getattr(p, end) for p in each]) for end in ("lower", "upper"))
        for deviation in share * self.fit.deviations:
            ends = [np.clip(values + step, lower, upper) for step in (deviation, -deviation)]
            size = np.where(deviation == 0.0, np.inf, np.abs(deviation))
            moved = max(ends, key=lambda end: float(np.sum(np.abs(end - values) / size)))
            yield inserted(chain, forms, moved[np.newaxis])

    def without(self, chain: Chain, place: int) -> Chain:
        """Chain with all candidates but one, at the values of the joint fit."""
        at = len(self.nuisance) + place
        forms = [form for i, form in enumerate(self.forms) if i != at]
        return inserted(chain, forms, np.delete(self.fit.rows, self.part(place), axis=1))


@frozen(eq=False)
class InitialFit:
    """Candidates before they are fitted: values (r, p) to fit from, and the cost of these."""

    candidates: tuple[Candidate, ...]
    rows: Array
    cost: float


class CandidateFitter:
    """Fits candidates to the records of one axis, each inserted into a chain.

    Starting values come from ``decimated_evidence``. Fits and scores use the full records. The
    ``nuisance`` forms are fitted with any candidates, and without.
    """

    def __init__(
        self, evidence: Sequence[Evidence], chain: Chain, nuisance: Sequence[EffectForm] = ()
    ) -> None:
        self.evidence, self.chain, self.nuisance = tuple(evidence), chain, tuple(nuisance)
        self.likelihood = Likelihood(self.evidence, chain)
        self._own: tuple[FittedCandidates | None, tuple[Array, ...]] = None, ()
        if self.nuisance:
            self.likelihood = Likelihood(self.evidence, self.without.extended(chain))

    @cached_property
    def without(self) -> FittedCandidates:
        """The nuisance forms alone."""
        neutral = np.concatenate([np.empty(0), *(form.neutral for form in self.nuisance)])
        rows = np.tile(neutral, (len(self.evidence), 1))
        found = self._fitted((), rows) if self.nuisance else None
        cells = self.likelihood.fit(self.chain)
        return found or FittedCandidates(
            (), Fit(rows, np.zeros_like(neutral)), cells, self.nuisance
        )

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
        candidate = candidate.at(scale_of(self.chain.model))
        candidates = (*(selected.candidates if selected else ()), candidate)
        before = (selected or self.without).fit.rows
        equivalent = (np.tile(s, (len(before), 1)) for s in candidate.form.starts(features))
        starts = (np.hstack((before, start)) for start in equivalent)
        found = self._decimated_problem(candidates).begin(
            starts,
            self._selected_influence(selected),
            new=slice(before.shape[1], None),
        )
        return InitialFit(candidates, *found) if found else None

    def fit(self, beginning: InitialFit) -> FittedCandidates | None:
        """Fit from starting values; None where the forms cannot be applied on the way."""
        return self._fitted(beginning.candidates, beginning.rows)

    def with_form(
        self, selected: FittedCandidates, place: int, form: EffectForm, features: ResidualFeatures
    ) -> FittedCandidates | None:
        """Fit with another form of one candidate; None where it cannot be applied."""
        owner, part, rows = selected.candidates[place], selected.part(place), selected.fit.rows
        begun = (np.tile(start, (len(rows), 1)) for start in form.starts(features))
        starts = (np.hstack((rows[:, : part.start], b, rows[:, part.stop :])) for b in begun)
        before, after = selected.candidates[:place], selected.candidates[place + 1 :]
        candidates = (*before, Candidate(owner.effect, form), *after)
        new = slice(part.start, part.start + len(form.parameters))
        found = self._decimated_problem(candidates).begin(starts, new=new)
        return self._fitted(candidates, found[0]) if found else None

    def reordered(self, selected: FittedCandidates) -> Iterator[FittedCandidates]:
        """Fit the selected candidates with the last one moved before each of the others.

        Order matters: an effect acts on the chain with the effects inserted before it.
        """
        *others, last = selected.candidates
        first, *values, of_last = np.split(selected.fit.rows, self._begins(selected), axis=1)
        for place in range(len(others)):
            candidates = (*others[:place], last, *others[place:])
            rows = np.hstack((first, *values[:place], of_last, *values[place:]))
            if trial := self._fitted(candidates, rows):
                yield trial

    @cached_property
    def _alone(self) -> bool:
        """Whether no record has the other axis."""
        return not any(each.playback.view.other.any() for each in self.evidence)

    @staticmethod
    def _begins(selected: FittedCandidates) -> list[int]:
        """Where the values of each candidate begin."""
        return [selected.part(place).start for place in range(len(selected.candidates))]

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
        return Problem(self.decimated_evidence, self.chain, self._forms(candidates))

    def _forms(self, candidates: Sequence[Candidate]) -> list[EffectForm]:
        return [*self.nuisance, *(candidate.form for candidate in candidates)]

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> FittedCandidates | None:
        forms = self._forms(candidates)
        evidence: Sequence[Evidence] = self.evidence
        begun = inserted(self.chain, forms, rows).of_record(0)
        disturbed = repeating(begun, self.chain.model.creep) != begun
        seen = Evidence.whitened if disturbed else Evidence.whitened_along
        trial = None
        for _ in range(SEARCH.reweightings):
            found = Problem(evidence, self.chain, forms, seen, self.span).descend(rows)
            if found is None:
                return None
            cells = self.likelihood.fit(inserted(self.chain, forms, found.rows))
            evidence, rows = self.likelihood.reweighted(cells), found.rows
            trial = FittedCandidates(candidates, found, cells, self.nuisance)
        return trial

    def on_fitted_stretches(self, selected: FittedCandidates) -> Chain:
        """Chain with the values fitted to every other stretch; those of all where that fails."""
        forms = selected.forms
        evidence = self.likelihood.reweighted(selected.cells)
        found = Problem(evidence, self.chain, forms, Evidence.on_fitted).descend(selected.fit.rows)
        return inserted(self.chain, forms, found.rows) if found else selected.extended(self.chain)

    @cached_property
    def span(self) -> float:
        """Log of the motion over the sensor's noise: between them lies the amount of an effect."""
        moved = max(float(each.playback.view.measured.std()) for each in self.evidence)
        least = max(float(np.linalg.norm(each.limit.noise)) for each in self.evidence)
        least = least or max(each.limit.total for each in self.evidence)
        return float(np.log(max(moved / least, math.e)))
