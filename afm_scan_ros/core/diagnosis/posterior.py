"""Posterior probabilities of sets of effects, from the evidence of all that were fitted.

The forms of an effect are one hypothesis, whose evidence is the sum over its forms. So is an effect
that a scanner has several times, as two tones.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from attrs import frozen
from scipy.special import logsumexp

from afm_scan_ros.core.diagnosis.candidates import LOG_ODDS, FittedCandidates
from afm_scan_ros.core.diagnosis.likelihood import BandFit

NEARLY = 0.01
"""Probability, relative to the most probable set, from which on a set is considered beside it."""
AS_PROBABLE = 0.05
"""Probability of a form over that of the most probable one, from which on it may be preferred."""
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
        cls, without: BandFit, trials: Iterable[FittedCandidates], outside: float = -np.inf
    ) -> "Posterior":
        """Posterior over the model ``without`` an effect and the sets of some trials.

        ``outside`` is the log evidence of what no effect describes; a scanner has it as often as
        one of the catalogue.
        """
        by_set: dict[Names, list[FittedCandidates]] = {}
        for trial in trials:
            by_set.setdefault(tuple(sorted(set(trial.names))), []).append(trial)
        distinct = {names: _distinct(found) for names, found in by_set.items()}
        logs: dict[Names, float] = {(): without.log_likelihood}
        if np.isfinite(outside):
            logs[OUTSIDE] = outside + LOG_ODDS
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
        near = (n for n, log in self.logs.items() if log > self.logs[first] + np.log(NEARLY))
        return next((n for n in near if n in self.best and self.best[n].bands.adequate), first)

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


def _simplest(trials: tuple[FittedCandidates, ...]) -> FittedCandidates:
    """Trial of the fewest parameters among those that are not far less probable than the first.

    Numbers that the records do not determine are left out so.
    """
    least = trials[0].log_posterior + np.log(AS_PROBABLE)
    near = (trial for trial in trials if trial.log_posterior >= least)
    return min(near, key=lambda trial: trial.fit.rows.shape[1])


def _distinct(trials: Iterable[FittedCandidates]) -> tuple[FittedCandidates, ...]:
    """Best trial of each set of forms, the best first: the order of effects is no hypothesis."""
    best: dict[Names, FittedCandidates] = {}
    for trial in sorted(trials, key=lambda each: -each.log_posterior):
        forms = sorted(f"{c.effect.name} {c.form.kind}" for c in trial.candidates)
        best.setdefault(tuple(forms), trial)
    return tuple(best.values())
