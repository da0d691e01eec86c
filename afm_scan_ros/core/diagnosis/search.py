"""Stepwise selection of effects on one axis: forward selection, then backward elimination.

A band at its detection limit counts 1 in the misfit. An effect must lower the misfit on the test
stretches by a penalty: for one more effect, for each of its parameters, and for the number of
candidates tried. Where two effects leave too much, pairs with the next best candidates are tried
too, because a third effect may imitate two that mask each other.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import CANDIDATES, CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.competing import (
    MARGIN,
    CompetingModel,
    EquivalentForm,
    Replacements,
    competing_models,
    distinguish_forms,
)
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.diagnosis.scoring import (
    complexity_penalty,
    lack_of_fit,
    reduction,
    score,
    significant_amplitude,
    undetermined_misfit,
)
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array

PENALTY_SHARE, PENALTY_SHARE_CONFUSABLE = 0.02, 0.1
"""Share of what the selected effects explain in a band that a further effect gains nothing by. A
formula approximates the physics, and its error resembles an effect that is confusable with it."""
MOST_EFFECTS = 3

FITTED = 6
"""Candidates that are fitted, of all those with starting values."""
SEEDS_FOR_PAIRS = 3
"""Single candidates beside which a second one may be searched for."""

ProgressCallback = Callable[[str], None]


@frozen(eq=False)
class Selection:
    """The effects selected on one axis. ``misfit_before`` is that of the model without them.

    ``first`` holds the single candidates, the best first. ``competing_models`` cannot be
    distinguished from a selected effect; other forms of it are included where that matters.
    ``equivalent`` holds all forms that fit as well.
    """

    misfit_before: float
    selected: FittedCandidates | None
    competing_models: tuple[CompetingModel, ...]
    equivalent: tuple[EquivalentForm, ...]
    first: tuple[FittedCandidates, ...]

    @property
    def misfit_after(self) -> float:
        """Misfit with all selected effects."""
        return self.selected.misfit if self.selected else self.misfit_before


class ModelSearch:
    """Selects effects on one axis; ``progress`` is called with the name of each candidate.

    ``features`` gives the features of the residual that a chain leaves.
    """

    def __init__(
        self,
        bench: CandidateFitter,
        features: Callable[[Chain], ResidualFeatures],
        progress: ProgressCallback,
    ) -> None:
        self._bench, self._features, self._progress = bench, features, progress
        self._before = bench.misfit(bench.chain)

    def select(self) -> Selection:
        """Select the effects that the records show."""
        first = () if self._at_limit(self._bench.chain) else self._tried(None)
        found: tuple[CompetingModel, ...] = ()
        equivalent: tuple[EquivalentForm, ...] = ()
        if selected := self._backwards(self._forwards(first)):
            selected, places = self._replaced(selected, first)
            selected, equivalent = distinguish_forms(self._bench, selected, self._with_forms)
            bands = sum(len(each.limit.rms) for each in self._bench.evidence)
            found = (
                *competing_models(selected, places, bands),
                *(a.competing for a in equivalent if a.matters),
            )
        return Selection(self._before, selected, found, equivalent, first)

    def _forwards(self, first: tuple[FittedCandidates, ...]) -> FittedCandidates | None:
        """Add effects one by one while the misfit falls by more than the penalty."""
        selected, trials = None, first
        while trials and self._improves(selected, best := _best_significant(trials)):
            selected = self._refined(best)
            if len(selected.candidates) == MOST_EFFECTS or self._at_limit(self._reached(selected)):
                break
            trials = self._tried(selected)
            if len(selected.candidates) == 1:
                trials = self._beside_others(trials, first)
        return selected

    def _beside_others(
        self, pairs: tuple[FittedCandidates, ...], first: tuple[FittedCandidates, ...]
    ) -> tuple[FittedCandidates, ...]:
        """Add pairs with the next best single candidates, until a pair fits well enough."""
        for beginning in first[1:SEEDS_FOR_PAIRS]:
            if not pairs or not self._leaves_too_much(pairs[0]):
                break
            if self._improves(None, beginning):
                more = self._tried(self._refined(beginning))
                pairs = tuple(sorted((*pairs, *more), key=score))
        return pairs

    def _improves(self, selected: FittedCandidates | None, more: FittedCandidates) -> bool:
        misfit = selected.misfit if selected else self._before
        return misfit - more.misfit >= self._penalty(selected, more) and significant_amplitude(more)

    def _refined(self, selected: FittedCandidates) -> FittedCandidates:
        """Choose the order of the effects, and for each the form with the lowest misfit."""
        selected = min((selected, *self._bench.reordered(selected)), key=score)
        for place, candidate in enumerate(selected.candidates):
            family = candidate.effect.family(candidate.form.kind)
            selected = min(
                (selected, *self._with_forms(selected, place, family)), key=undetermined_misfit
            )
        return selected

    def _with_forms(
        self, selected: FittedCandidates, place: int, forms: Iterable[EffectForm]
    ) -> Iterator[FittedCandidates]:
        for form in forms:
            if form is not selected.candidates[place].form:
                features = self._features(selected.without(self._bench.chain, place))
                if trial := self._bench.with_form(selected, place, form, features):
                    yield trial

    def _backwards(self, selected: FittedCandidates | None) -> FittedCandidates | None:
        """Drop effects that later ones have made redundant."""
        while selected and len(selected.candidates) > 1:
            fewer = [(i, self._bench.without(selected, i)) for i in range(len(selected.candidates))]
            pays = {
                i: trial.misfit - selected.misfit - complexity_penalty(selected.candidates[i])
                for i, trial in fewer
                if trial
            }
            least = min(pays, key=pays.__getitem__, default=None)
            if least is None or pays[least] > 0.0:
                break
            selected = fewer[least][1]
        return selected

    def _replaced(
        self, selected: FittedCandidates, first: tuple[FittedCandidates, ...]
    ) -> tuple[FittedCandidates, Sequence[Replacements]]:
        """Replace effects by better ones while any replacement improves the score.

        The first effect was fitted to a residual that held the others too. Also returns the trials
        in each place.
        """
        selected = self._with_related_forms(selected)
        places = self._places(selected, first)
        for _ in range(MOST_EFFECTS):
            tried = [trial for place in places for trial in place.trials]
            best = _best_significant(tried) if tried else selected
            gain = score(selected) - score(best)
            if gain < self._penalty(selected, best) or not significant_amplitude(best):
                break
            selected = self._with_related_forms(self._refined(self._backwards(best) or best))
            places = self._places(selected, first)
        return selected, places

    def _with_related_forms(self, selected: FittedCandidates) -> FittedCandidates:
        """Try other forms of each effect, dropping effects that a form makes redundant."""
        for place in range(len(selected.candidates)):
            others = (
                self._backwards(trial) for trial in self._bench.related_forms(selected, place)
            )
            best = min((trial for trial in others if trial), key=score, default=selected)
            if score(best) < score(selected):
                return best
        return selected

    def _places(
        self, selected: FittedCandidates, first: tuple[FittedCandidates, ...]
    ) -> Sequence[Replacements]:
        """Trials of replacements for each selected effect."""
        places: list[Replacements] = []
        for owner in range(len(selected.candidates)):
            rest = self._bench.without(selected, owner)
            misfit = rest.misfit if rest else self._before
            places.append(Replacements(misfit, self._tried(rest) if rest else first))
        return places

    def _tried(self, selected: FittedCandidates | None) -> tuple[FittedCandidates, ...]:
        """Fit the most promising candidates beside those selected; the best comes first."""
        features, begun = self._features(self._reached(selected)), []
        for candidate in CANDIDATES:
            self._progress(candidate.effect.name)
            begun.append(self._bench.begin(selected, candidate, features))
        promising = sorted((b for b in begun if b), key=lambda b: b.cost)[:FITTED]
        trials = (self._bench.fit(beginning) for beginning in promising)
        return tuple(sorted((t for t in trials if t), key=score))

    def _penalty(self, selected: FittedCandidates | None, trial: FittedCandidates) -> float:
        """Reduction of the misfit that a trial must reach beside the selected effects.

        In each band, a share of what the selected effects explain does not count as a gain.
        """
        *before, one_more = trial.candidates
        akin = any(
            one_more.effect.name in (known.effect.name, *known.effect.confusable)
            for known in before
        )
        share = PENALTY_SHARE_CONFUSABLE if akin else PENALTY_SHARE
        reached = self._ratios(selected)
        within_formula_error = share * reduction(self._ratios(None), reached)
        gained = reduction(reached, self._ratios(trial))
        return float(np.minimum(within_formula_error, gained).sum()) + complexity_penalty(one_more)

    def _reached(self, selected: FittedCandidates | None) -> Chain:
        return selected.extended(self._bench.chain) if selected else self._bench.chain

    def _leaves_too_much(self, selected: FittedCandidates) -> bool:
        return lack_of_fit(self._ratios(None), self._ratios(selected))

    def _ratios(self, selected: FittedCandidates | None) -> list[Array]:
        chain = self._reached(selected)
        return [each.ratio(chain) for each in self._bench.evidence]

    def _at_limit(self, chain: Chain) -> bool:
        return max(float(e.ratio(chain).max()) for e in self._bench.evidence) < AT_LIMIT


def _best_significant(trials: Sequence[FittedCandidates]) -> FittedCandidates:
    """Return the best significant trial among those nearly as good as the best.

    A formula of many parameters may imitate a simpler one without a significant amplitude.
    """
    best, *_ = ranked = sorted(trials, key=score)
    near = (trial for trial in ranked if score(trial) < score(best) + MARGIN)
    return next((trial for trial in near if significant_amplitude(trial)), best)
