"""Candidates tried on one axis: fitted to what teaches, scored on what tests."""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence, misfit
from afm_scan_ros.core.diagnosis.fit import Fit, Problem
from afm_scan_ros.core.diagnosis.glance import glance
from afm_scan_ros.core.diagnosis.layout import inserted
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectType
from afm_scan_ros.core.effects.registry import CATALOGUE
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Candidate:
    """A form of a catalogue entry."""

    entry: EffectType
    form: EffectForm


CANDIDATES = tuple(
    Candidate(entry, form) for entry in CATALOGUE for form in entry.forms if form.refines is None
)


@frozen(eq=False)
class Trial:
    """Candidates fitted together, and the misfit they leave on what tests."""

    candidates: tuple[Candidate, ...]
    fit: Fit
    misfit: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(candidate.entry.name for candidate in self.candidates)

    def part(self, place: int) -> slice:
        """Where the parameters of one of the candidates stand among those of all."""
        first = sum(len(c.form.parameters) for c in self.candidates[:place])
        return slice(first, first + len(self.candidates[place].form.parameters))

    def extended(self, chain: Chain) -> Chain:
        """Chain with the candidates at the fitted values."""
        return inserted(chain, [c.form for c in self.candidates], self.fit.rows)

    def without(self, chain: Chain, place: int) -> Chain:
        """Chain with all candidates but one, the rest as they were fitted beside it."""
        forms = [c.form for i, c in enumerate(self.candidates) if i != place]
        return inserted(chain, forms, np.delete(self.fit.rows, self.part(place), axis=1))


@frozen(eq=False)
class Beginning:
    """Candidates before they are fitted: values (r, p) to fit from, and the cost of these."""

    candidates: tuple[Candidate, ...]
    rows: Array
    cost: float


class Bench:
    """Where candidates are tried: the records of one axis and the chain that is to explain them.

    Fits begin from ``glances`` at the records, and are made and judged on the records themselves.
    """

    def __init__(self, evidence: Sequence[Evidence], chain: Chain) -> None:
        self.evidence = evidence
        self.chain = chain
        self._own: tuple[Trial | None, tuple[Array, ...]] = None, ()

    @cached_property
    def glances(self) -> tuple[Evidence, ...]:
        """What fits begin from: of each record as much as it takes."""
        return tuple(glance(each, self.chain) for each in self.evidence)

    def begin(
        self, kept: Trial | None, candidate: Candidate, clues: ResidualFeatures
    ) -> Beginning | None:
        """Begin a candidate beside those kept; None where it cannot be applied."""
        candidates = (*(kept.candidates if kept else ()), candidate)
        before = kept.fit.rows if kept else np.empty((len(self.evidence), 0))
        alike = (np.tile(s, (len(before), 1)) for s in candidate.form.starts(clues))
        starts = (np.hstack((before, start)) for start in alike)
        found = self._glanced(candidates).begin(starts, self._own_influence(kept))
        return Beginning(candidates, *found) if found else None

    def fit(self, beginning: Beginning) -> Trial | None:
        """Fit what was begun; None where it cannot be applied on the way."""
        return self._fitted(beginning.candidates, beginning.rows)

    def without(self, kept: Trial, place: int) -> Trial | None:
        """Fit what is kept but for one; None where nothing is left."""
        rest = tuple(c for i, c in enumerate(kept.candidates) if i != place)
        rows = np.delete(kept.fit.rows, kept.part(place), axis=1)
        return self._fitted(rest, rows) if rest else None

    def exchanged(
        self, kept: Trial, place: int, form: EffectForm, clues: ResidualFeatures
    ) -> Trial | None:
        """Fit what is kept with another form of one; None where it cannot be applied."""
        owner, part, rows = kept.candidates[place], kept.part(place), kept.fit.rows
        begun = (np.tile(start, (len(rows), 1)) for start in form.starts(clues))
        starts = (np.hstack((rows[:, : part.start], b, rows[:, part.stop :])) for b in begun)
        before, after = kept.candidates[:place], kept.candidates[place + 1 :]
        candidates = (*before, Candidate(owner.entry, form), *after)
        found = self._glanced(candidates).begin(starts)
        return self._fitted(candidates, found[0]) if found else None

    def kindred(self, kept: Trial, place: int) -> Iterator[Trial]:
        """Fit the effect in a place in its other forms that have its parameters, from its values.

        A riding mass that shows as a mode alone has often moved a resonance too.
        """
        before, after = kept.candidates[:place], kept.candidates[place + 1 :]
        candidate = kept.candidates[place]
        for form in candidate.entry.forms:
            if form is not candidate.form and _names(form) == _names(candidate.form):
                candidates = (*before, Candidate(candidate.entry, form), *after)
                if trial := self._fitted(candidates, kept.fit.rows):
                    yield trial

    def reordered(self, kept: Trial) -> Iterator[Trial]:
        """Fit what is kept with the last of it before each of the others.

        What is put into the chain first is met by what comes later: springs that yield swing as the
        stage does with a leg, or as it does without one.
        """
        *others, last = kept.candidates
        *values, of_last = np.split(kept.fit.rows, self._ends(kept), axis=1)
        for place in range(len(others)):
            candidates = (*others[:place], last, *others[place:])
            rows = np.hstack((*values[:place], of_last, *values[place:]))
            if trial := self._fitted(candidates, rows):
                yield trial

    def misfit(self, chain: Chain) -> float:
        """Misfit of a chain on what tests."""
        return misfit(self.evidence, chain, taught=False)

    @staticmethod
    def _ends(kept: Trial) -> list[int]:
        """Where the values of each candidate but the last end."""
        return [kept.part(place).stop for place in range(len(kept.candidates) - 1)]

    def _own_influence(self, kept: Trial | None) -> tuple[Array, ...]:
        """Of those kept, found once for all that are begun beside them: a comb has many values."""
        if kept and self._own[0] is not kept:
            self._own = kept, self._glanced(kept.candidates).own_influence(kept.fit.rows)
        return self._own[1] if kept else ()

    def _glanced(self, candidates: Sequence[Candidate]) -> Problem:
        return Problem(self.glances, self.chain, [c.form for c in candidates])

    def _fitted(self, candidates: tuple[Candidate, ...], rows: Array) -> Trial | None:
        forms = [candidate.form for candidate in candidates]
        found = Problem(self.evidence, self.chain, forms).descend(rows)
        if found is None:
            return None
        chain = inserted(self.chain, forms, found.rows)
        return Trial(candidates, found, self.misfit(chain))


def _names(form: EffectForm) -> tuple[str, ...]:
    return tuple(parameter.name for parameter in form.parameters)
