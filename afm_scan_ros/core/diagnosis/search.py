"""Beam search over sets of up to three effects on one axis."""

from collections.abc import Callable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import CANDIDATES, CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.likelihood import BandFit
from afm_scan_ros.core.diagnosis.posterior import NEARLY, OUTSIDE, Posterior
from afm_scan_ros.core.effects.residual_features import ResidualFeatures

MOST_EFFECTS = 3
BEAM = 3
"""Sets of one size that are extended."""
FITTED = 6
"""Candidates that are fitted beside a set, of all those with starting values."""

ProgressCallback = Callable[[str], None]


@frozen(eq=False)
class Selection:
    """Trials of one axis, ``without`` an effect, and their posterior."""

    without: BandFit
    trials: tuple[FittedCandidates, ...]
    posterior: Posterior

    @property
    def selected(self) -> FittedCandidates | None:
        """Best trial of the likeliest set; None where that is no effect."""
        return self.posterior.best.get(self.posterior.likeliest)

    @property
    def reached(self) -> BandFit:
        """Fit of the likeliest set."""
        return self.selected.bands if self.selected else self.without


class ModelSearch:
    """Searches sets of effects; ``progress`` is called with the name of each candidate.

    ``features`` gives the features of the residual that a chain leaves.
    """

    def __init__(
        self,
        fitter: CandidateFitter,
        features: Callable[[Chain], ResidualFeatures],
        progress: ProgressCallback,
    ) -> None:
        self.fitter, self._features, self._progress = fitter, features, progress
        self._without = fitter.likelihood.fit(fitter.chain)
        self._outside = fitter.likelihood.outside()
        self._trials: list[FittedCandidates] = []
        self._found: list[FittedCandidates] = []
        self._size = 0

    def select(self) -> Selection:
        """Fit sets of growing size, as long as more effects may explain more."""
        while self._size < MOST_EFFECTS and self._may_grow():
            self.grow()
        return self.selection

    def grow(self) -> None:
        """Fit sets of one effect more."""
        parents: list[FittedCandidates | None] = [*self._parents()] if self._size else [None]
        found = [trial for parent in parents for trial in self._beside(parent)]
        found += [trial for best in _best(found, 2) for trial in self._other_forms(best)]
        self._trials += found
        self._found, self._size = found, self._size + 1

    @property
    def selection(self) -> Selection:
        """What was found so far."""
        posterior = Posterior.of(self._without, self._trials, self._outside)
        return Selection(self._without, tuple(self._trials), posterior)

    def _may_grow(self) -> bool:
        """Whether something is left, and sets of the last size explain more than smaller ones."""
        posterior = self.selection.posterior
        named = next(names for names in posterior.logs if names != OUTSIDE)
        best = posterior.best.get(named)
        if self._size and (best is None or len(best.candidates) < self._size):
            return False
        return not (best.bands if best else self._without).unremarkable

    def _parents(self) -> Iterator[FittedCandidates]:
        """Yield the sets to extend: those near the best, more where the best lacks something."""
        best, *others = _best(self._found, BEAM)
        yield best
        lacking = self._size == 1 and not best.bands.adequate
        for other in others:
            if lacking or other.log_posterior > best.log_posterior + np.log(NEARLY):
                yield other

    def _beside(self, parent: FittedCandidates | None) -> Iterator[FittedCandidates]:
        """Fit the most promising candidates beside a set."""
        chain = parent.extended(self.fitter.chain) if parent else self.fitter.chain
        features, begun = self._features(chain), []
        present = parent.names if parent else ()
        for candidate in CANDIDATES:
            if candidate.effect.name in present and not candidate.form.repeatable:
                continue
            self._progress(candidate.effect.name)
            begun.append(self.fitter.begin(parent, candidate, features))
        promising = sorted((b for b in begun if b), key=lambda b: b.cost)[:FITTED]
        for beginning in promising:
            if trial := self.fitter.fit(beginning):
                yield trial

    def _other_forms(self, trial: FittedCandidates) -> Iterator[FittedCandidates]:
        """Fit the other forms of each effect, and the other orders of the last one."""
        yield from self.fitter.reordered(trial)
        for place, candidate in enumerate(trial.candidates):
            features = self._features(trial.without(self.fitter.chain, place))
            for form in candidate.effect.forms:
                if form is not candidate.form:
                    other = self.fitter.with_form(trial, place, form, features)
                    if other:
                        yield other


def _best(trials: list[FittedCandidates], count: int) -> Iterator[FittedCandidates]:
    """Yield the best trials of distinct sets of effects."""
    seen: list[tuple[str, ...]] = []
    for trial in sorted(trials, key=lambda t: -t.log_posterior):
        names = tuple(sorted(trial.names))
        if names not in seen and len(seen) < count:
            seen.append(names)
            yield trial
