"""Sets of effects of coupled axes: each fitted, simulated on held-out records, and compared."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from attrs import frozen
from scipy.special import logsumexp

from afm_scan_ros.core.coupled_scanner import CoupledScanner, elements_of, valued
from afm_scan_ros.core.diagnosis.coupled.evidence import DiagnosedRecords, HeldOutLikelihood
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.search import OUTSIDE, Names
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.effect_type import Actuators
from afm_scan_ros.core.effects.registry import COUPLED_EFFECTS, changes_linearly
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.state_space.feedback import (
    COARSE,
    FeedbackModel,
    fit_feedback,
)
from afm_scan_ros.core.identification.state_space.fit import fit_state_space, refined
from afm_scan_ros.core.identification.state_space.identify import Teaching, actuators_of
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.spectra import joined
from afm_scan_ros.core.types import Array, ProgressCallback, Tally

MOST = 2
"""Effects of a set."""
LOG_ODDS = float(np.log(SEARCH.expected / len(COUPLED_EFFECTS)))


@frozen(eq=False)
class FittedSet:
    """A set of effects, what it makes of the held-out records, and what it leaves of them."""

    names: Names
    simulated: Array
    bands: CellFit
    adequate: bool

    @property
    def log_posterior(self) -> float:
        """Log of prior times likelihood, in nats."""
        return self.bands.log_likelihood + LOG_ODDS * len(self.names)


@frozen(eq=False)
class SetPosterior:
    """Trials of sets by their names, none being the empty set, with what no effect describes.

    The log evidence ``outside`` is in nats. ``unsettled`` are sets whose simulation diverges.
    """

    trials: dict[Names, FittedSet]
    outside: float
    unsettled: tuple[Names, ...]

    @property
    def logs(self) -> dict[Names, float]:
        """Log probability of each set, the likeliest first."""
        found = {names: trial.log_posterior for names, trial in self.trials.items()}
        found[OUTSIDE] = self.outside + LOG_ODDS
        total = float(logsumexp(list(found.values())))
        return {names: found[names] - total for names in sorted(found, key=lambda n: -found[n])}

    @property
    def likeliest(self) -> Names:
        """The most probable set."""
        return next(iter(self.logs))

    def of_effect(self, name: str) -> float:
        """Probability that the scanner has an effect."""
        return sum(float(np.exp(log)) for names, log in self.logs.items() if name in names)

    def credible(self, share: float) -> tuple[Names, ...]:
        """Fewest sets that hold a share of the probability."""
        reached = np.cumsum(np.exp(list(self.logs.values())))
        return tuple(self.logs)[: 1 + int(np.searchsorted(reached, share))]


class CoupledSearch:
    """Fits sets of effects beside those that the model has, from single ones on."""

    def __init__(
        self, scanner: CoupledScanner, records: DiagnosedRecords, progress: ProgressCallback
    ) -> None:
        self.likelihood = HeldOutLikelihood.of(scanner, records)
        self._has, self._records = tuple(e.name for e in scanner.effects), records
        self._order, self._tally = scanner.linear.order, Tally(progress)

    def run(self) -> SetPosterior:
        """Search until the likeliest set lacks nothing, or no larger one is likelier."""
        trials: dict[Names, FittedSet] = {(): self._judged((), self.likelihood.base)}
        outside, unsettled = self.likelihood.outside(), set[Names]()
        found = SetPosterior(trials, outside, ())
        for size in range(1, MOST + 1):
            best = max(trials.values(), key=lambda trial: trial.log_posterior)
            if len(best.names) < size - 1 or (best.adequate and best.bands.unremarkable):
                break
            larger = [*_extended(trials, size, self._has)]
            self._tally.plan(len(larger))
            for names in larger:
                self._tally.begin(f"fitting {' and '.join(names)}")
                if trial := self._trial(names):
                    trials[names] = trial
                else:
                    unsettled.add(names)
            found = SetPosterior(dict(trials), outside, tuple(sorted(unsettled)))
        return found

    @cached_property
    def _teaching(self) -> dict[bool, Teaching]:
        """Records to fit, by whether the structure has changed since it was identified."""
        return {one: self._records.teaching(changed=one) for one in (False, True)}

    @cached_property
    def _start(self) -> StateSpaceModel:
        """Structure fitted to the least amplitude that is diagnosed, from which all sets start."""
        return fit_state_space(self._teaching[True].spectra[0].every(COARSE), self._order)

    @cached_property
    def _actuators(self) -> Actuators:
        return actuators_of(self._start, self._teaching[True])

    def _trial(self, names: Names) -> FittedSet | None:
        """Fit a set to all but the held-out records; None where its simulation diverges."""
        changed = any(map(changes_linearly, names))
        try:
            model = self._fitted(names, changed=changed)
            simulated = self.likelihood.simulated(model, changed=changed)
        except ScanError:
            return None
        return self._judged(names, simulated)

    def _judged(self, names: Names, simulated: Array) -> FittedSet:
        bands = self.likelihood.fit(simulated, exact=all(map(changes_linearly, names)))
        return FittedSet(names, simulated, bands, self.likelihood.explains(bands))

    def _fitted(self, names: Names, *, changed: bool) -> FeedbackModel:
        taught = self._teaching[changed]
        steady = taught.steady()
        elements = elements_of(valued((*self._has, *names), self._actuators), self._actuators)
        if elements:
            return fit_feedback(steady, self._start, elements, COARSE)
        linear = refined(self._start, joined(taught.spectra).every(COARSE))
        return FeedbackModel(linear, (), steady.band)


def _extended(trials: dict[Names, FittedSet], size: int, has: Names) -> Iterator[Names]:
    """Yield the sets of a size that add an effect to the likely ones which have one less."""
    smaller = [trial for names, trial in trials.items() if len(names) == size - 1]
    best = max((trial.log_posterior for trial in smaller), default=np.inf)
    parents = [t.names for t in smaller if t.log_posterior >= best + np.log(SEARCH.near)]
    names = [effect.name for effect in COUPLED_EFFECTS if effect.name not in has]
    each = ((*parent, name) for parent in parents for name in names if name not in parent)
    yield from dict.fromkeys(tuple(sorted(one)) for one in each)
