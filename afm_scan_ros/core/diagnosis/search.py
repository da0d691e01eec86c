"""Beam search over sets of effects of one axis, and their posterior probabilities.

The forms of an effect are one hypothesis, whose evidence is the sum over its forms. So is an effect
that a scanner has several times, as two tones.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
from attrs import frozen
from scipy.special import logsumexp
from scipy.stats import chi2

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import (
    CANDIDATES,
    LOG_ODDS,
    Candidate,
    CandidateFitter,
    FittedCandidates,
)
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array, Tally

Names = tuple[str, ...]
"""Names of the effects of a set, in alphabetical order; none is the empty set."""
OUTSIDE: Names = ("outside",)
"""What no effect of the catalogue describes."""


@frozen(eq=False)
class Posterior:
    """Log posterior (nats) of each set of effects, the likeliest first, and its trials.

    ``evidence`` is the log evidence of all sets together.
    """

    logs: Mapping[Names, float]
    evidence: float
    trials: Mapping[Names, tuple[FittedCandidates, ...]]

    @classmethod
    def of(
        cls,
        without: FittedCandidates,
        trials: Sequence[FittedCandidates],
        outside: float = -np.inf,
        counts: Array | float = 1.0,
    ) -> "Posterior":
        """Posterior over the model ``without`` an effect and the sets of some trials.

        A trial that is a simpler one of another set is no further hypothesis. ``outside`` is the
        log evidence of what no effect describes; a scanner has it as often as one of the catalogue.
        It has a shape of its own, which the likeliest trial tells, of the ``counts`` (cells,) of
        coefficients.
        """
        by_set: dict[Names, list[FittedCandidates]] = {}
        trials = [trial for trial in trials if not any(_is(trial, other) for other in trials)]
        for trial in trials:
            by_set.setdefault(tuple(sorted(set(trial.names))), []).append(trial)
        distinct = {names: _distinct(found) for names, found in by_set.items()}
        logs: dict[Names, float] = {(): without.log_posterior}
        if np.isfinite(outside):
            logs[OUTSIDE] = outside + LOG_ODDS
            if trials:
                likeliest = max(trials, key=lambda trial: trial.log_posterior)
                logs[OUTSIDE] -= likeliest.cells.shape_told(without.cells.power, counts)
        for names, found in distinct.items():
            logs[names] = float(logsumexp([trial.log_posterior for trial in found]))
        total = float(logsumexp(list(logs.values())))
        ranked = sorted(logs, key=lambda names: -logs[names])
        return cls({names: logs[names] - total for names in ranked}, total, distinct)

    @property
    def probability(self) -> dict[Names, float]:
        """Probability of each set, the likeliest first."""
        return {names: float(np.exp(log)) for names, log in self.logs.items()}

    @property
    def best(self) -> dict[Names, FittedCandidates]:
        """Best trial of each set, or a simpler one that is nearly as probable."""
        return {names: _simplest(trials) for names, trials in self.trials.items()}

    @property
    def likeliest(self) -> Names:
        """The most probable set, or one nearly as probable that lacks nothing where it does."""
        first = next(iter(self.logs))
        if first not in self.best:
            return first
        near = (n for n, log in self.logs.items() if log > self.logs[first] + np.log(SEARCH.near))
        return next((n for n in near if n in self.best and self.best[n].cells.adequate), first)

    def of_effect(self, name: str) -> float:
        """Probability that a scanner has an effect."""
        return sum(p for names, p in self.probability.items() if name in names)

    def kinds(self, name: str) -> tuple[tuple[str, float], ...]:
        """Probabilities of the forms of an effect, given the likeliest set."""
        trials = self.trials[self.likeliest]
        total = logsumexp([trial.log_posterior for trial in trials])
        found: dict[str, float] = {}
        for trial in trials:
            kind = trial.candidates[trial.names.index(name)].form.kind
            found[kind] = found.get(kind, 0.0) + float(np.exp(trial.log_posterior - total))
        return tuple(found.items())

    def log_odds(self, names: Names, other: Names) -> float:
        """Log of the probability of a set over that of another; infinite where that is untried."""
        return self.logs[names] - self.logs.get(other, -np.inf)

    def credible(self, share: float) -> tuple[Names, ...]:
        """Smallest collection of sets that holds a share of the probability."""
        reached = np.cumsum(list(self.probability.values()))
        return tuple(self.logs)[: 1 + int(np.searchsorted(reached, share))]


def _is(trial: FittedCandidates, other: FittedCandidates) -> bool:
    """Whether a trial is, at an end of a range, another set of fewer numbers: it fits as well.

    Plays of no width are a spring, and of two effects that of no amount is none. The further
    numbers gain half a chi-squared of as many in likelihood (Wilks, Ann. Math. Stat. 9, 1938, 60).
    """
    more = trial.fit.rows.shape[1] - other.fit.rows.shape[1]
    if more <= 0 or set(other.names) == set(trial.names) or not trial.may_be_at_end:
        return False
    gained = trial.cells.log_likelihood - other.cells.log_likelihood
    return bool(abs(gained) <= 0.5 * chi2.ppf(SEARCH.certain, more))


def _simplest(trials: tuple[FittedCandidates, ...]) -> FittedCandidates:
    """Trial of the fewest parameters among those that are not far less probable than the first.

    Numbers that the records do not determine are left out so. One that lacks something gives way.
    """
    first = trials[0].log_posterior
    near = [t for t in trials if t.log_posterior >= first + np.log(SEARCH.near)]
    adequate = [t for t in near if t.cells.adequate] or near
    least = adequate[0].log_posterior + np.log(SEARCH.as_probable)
    as_probable = (t for t in adequate if t.log_posterior >= least)
    return min(as_probable, key=lambda trial: trial.fit.rows.shape[1])


def _distinct(trials: Iterable[FittedCandidates]) -> tuple[FittedCandidates, ...]:
    """Best trial of each set of forms, the best first: the order of effects is no hypothesis."""
    best: dict[Names, FittedCandidates] = {}
    for trial in sorted(trials, key=lambda each: -each.log_posterior):
        forms = sorted(f"{c.effect.name} {c.form.kind}" for c in trial.candidates)
        best.setdefault(tuple(forms), trial)
    return tuple(best.values())


@frozen(eq=False)
class Selection:
    """Trials of one axis, ``without`` an effect, and their posterior."""

    without: FittedCandidates
    trials: tuple[FittedCandidates, ...]
    posterior: Posterior

    @property
    def selected(self) -> FittedCandidates | None:
        """Best trial of the likeliest set; None where that is no effect."""
        return self.posterior.best.get(self.posterior.likeliest)

    @property
    def refitted(self) -> Iterator[tuple[str, float]]:
        """Names and values of what was fitted anew of the model."""
        found = self.selected or self.without
        names = (p.name for form in found.nuisance for p in form.parameters)
        return zip(names, found.fit.values.tolist(), strict=False)

    @property
    def reached(self) -> CellFit:
        """Fit of the likeliest set."""
        return (self.selected or self.without).cells


class ModelSearch:
    """Searches sets of effects, whose fits are counted by a ``tally``.

    ``features`` gives the features of the residual that a chain leaves.
    """

    def __init__(
        self,
        fitter: CandidateFitter,
        features: Callable[[Chain], ResidualFeatures],
        tally: Tally,
    ) -> None:
        self.fitter, self._features, self._tally = fitter, features, tally
        self._without = fitter.without
        self._outside = fitter.likelihood.outside()
        self._trials: list[FittedCandidates] = []
        self._found: list[FittedCandidates] = []
        self._size = 0

    def select(self) -> Selection:
        """Fit sets of growing size, as long as more effects may explain more."""
        while self._size < SEARCH.most_effects and self._may_grow():
            self.grow()
        return self.selection

    def grow(self) -> None:
        """Fit sets of one effect more."""
        parents: list[FittedCandidates | None] = [*self._parents()] if self._size else [None]
        self._tally.plan(sum(len(_addable(parent)) + SEARCH.fitted for parent in parents))
        found = [trial for parent in parents for trial in self._beside(parent)]
        found += [trial for best in _best(found, 2) for trial in self._other_forms(best)]
        self._trials += found
        self._found, self._size = found, self._size + 1

    @property
    def selection(self) -> Selection:
        """What was found so far."""
        found = self._outside, self.fitter.likelihood.counts
        posterior = Posterior.of(self._without, self._trials, *found)
        return Selection(self._without, tuple(self._trials), posterior)

    def _may_grow(self) -> bool:
        """Whether something is left, and sets of the last size explain more than smaller ones."""
        posterior = self.selection.posterior
        named = next(names for names in posterior.logs if names != OUTSIDE)
        best = posterior.best.get(named)
        if self._size and (best is None or len(best.candidates) < self._size):
            return False
        reached = best or self._without
        if not reached.cells.unremarkable:
            return True
        return self._features(reached.extended(self.fitter.chain)).beyond_noise

    def _parents(self) -> Iterator[FittedCandidates]:
        """Yield the sets to extend: those near the best, more where the best lacks something."""
        best, *others = _best(self._found, SEARCH.extended)
        yield best
        lacking = self._size == 1 and not best.cells.adequate
        for other in others:
            if lacking or other.log_posterior > best.log_posterior + np.log(SEARCH.near):
                yield other

    def _beside(self, parent: FittedCandidates | None) -> Iterator[FittedCandidates]:
        """Fit the most promising candidates beside a set."""
        chain = (parent or self._without).extended(self.fitter.chain)
        features, begun = self._features(chain), []
        for candidate in _addable(parent):
            self._tally.begin(f"trying {candidate.effect.name}")
            begun.append(self.fitter.begin(parent, candidate, features))
        promising = sorted((b for b in begun if b), key=lambda b: b.cost)[: SEARCH.fitted]
        self._tally.plan(len(promising) - SEARCH.fitted)
        for beginning in promising:
            self._tally.begin(_fitting(beginning.candidates))
            if trial := self.fitter.fit(beginning):
                yield trial

    def _other_forms(self, trial: FittedCandidates) -> Iterator[FittedCandidates]:
        """Fit the other forms of each effect, and the other orders of the last one."""
        others = sum(len(candidate.effect.forms) for candidate in trial.candidates) - 1
        self._tally.plan(others)
        self._tally.begin(f"{_fitting(trial.candidates)} in other forms", others)
        yield from self.fitter.reordered(trial)
        for place, candidate in enumerate(trial.candidates):
            features = self._features(trial.without(self.fitter.chain, place))
            for form in candidate.effect.forms:
                if form is not candidate.form:
                    other = self.fitter.with_form(trial, place, form, features)
                    if other:
                        yield other


def _addable(parent: FittedCandidates | None) -> list[Candidate]:
    """Candidates that are tried beside a set."""
    present = parent.names if parent else ()
    return [c for c in CANDIDATES if c.effect.name not in present or c.form.repeatable]


def _fitting(candidates: Iterable[Candidate]) -> str:
    return f"fitting {' and '.join(each.effect.name for each in candidates)}"


def _best(trials: list[FittedCandidates], count: int) -> Iterator[FittedCandidates]:
    """Yield the best trials of distinct sets of effects."""
    seen: list[tuple[str, ...]] = []
    for trial in sorted(trials, key=lambda t: -t.log_posterior):
        names = tuple(sorted(trial.names))
        if names not in seen and len(seen) < count:
            seen.append(names)
            yield trial
