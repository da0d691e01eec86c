"""Effects selected on one axis: forwards while one pays, backwards where one has ceased to.

Misfits count a band at its floor as 1. An effect must lower the misfit on what tests by a price:
for being one more, for each of its parameters, and for the number of candidates tried. Where
two leave too much, pairs with those next to the best are tried too: of two effects that hide each
other, what stands for both may be the best alone.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.floor import AT_FLOOR
from afm_scan_ros.core.diagnosis.forms import Alike, told_apart
from afm_scan_ros.core.diagnosis.remainder import lowered, too_much
from afm_scan_ros.core.diagnosis.rivals import MARGIN, Place, Rival, rivals
from afm_scan_ros.core.diagnosis.trial import CANDIDATES, Bench, Trial
from afm_scan_ros.core.diagnosis.worth import certain, cost, price, untold
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.types import Array

PRICE_SHARE, PRICE_SHARE_AKIN = 0.02, 0.1
"""Of what those before it explain in a band: a formula is not quite the physics, and what it leaves
there looks like an effect that it can be mistaken for."""
MOST_EFFECTS = 3

FITTED = 6
"""Of the candidates begun, those that are fitted to the end."""
BEGINNINGS = 3
"""Of the candidates tried alone, those beside which another may be sought."""

Told = Callable[[str], None]


@frozen(eq=False)
class Selection:
    """What was selected on one axis. ``misfit_before`` is that of the bare model.

    ``first`` holds all candidates tried alone, the best first; ``rivals`` what cannot be told from
    one selected, other forms of it where that matters; ``alike`` all forms that do as well.
    """

    misfit_before: float
    kept: Trial | None
    rivals: tuple[Rival, ...]
    alike: tuple[Alike, ...]
    first: tuple[Trial, ...]

    @property
    def misfit_after(self) -> float:
        """Misfit with all that was selected."""
        return self.kept.misfit if self.kept else self.misfit_before


class Selector:
    """Selects effects on one axis; ``told`` hears what is tried.

    ``clues`` gives what is seen of the residual that a chain leaves.
    """

    def __init__(
        self, bench: Bench, clues: Callable[[Chain], ResidualFeatures], told: Told
    ) -> None:
        self._bench, self._clues, self._told = bench, clues, told
        self._before = bench.misfit(bench.chain)

    def select(self) -> Selection:
        """Select the effects that the records show."""
        first = () if self._at_floor(self._bench.chain) else self._tried(None)
        found: tuple[Rival, ...] = ()
        alike: tuple[Alike, ...] = ()
        if kept := self._backwards(self._forwards(first)):
            kept, places = self._swapped(kept, first)
            kept, alike = told_apart(self._bench, kept, self._exchanged)
            bands = sum(len(each.floor.rms) for each in self._bench.evidence)
            found = (*rivals(kept, places, bands), *(a.rival for a in alike if a.matters))
        return Selection(self._before, kept, found, alike, first)

    def _forwards(self, first: tuple[Trial, ...]) -> Trial | None:
        """Add what pays, one by one, from what was tried alone on."""
        kept, trials = None, first
        while trials and self._pays(kept, best := _likeliest(trials)):
            kept = self._refined(best)
            if len(kept.candidates) == MOST_EFFECTS or self._at_floor(self._reached(kept)):
                break
            trials = self._tried(kept)
            if len(kept.candidates) == 1:
                trials = self._beside_others(trials, first)
        return kept

    def _beside_others(
        self, pairs: tuple[Trial, ...], first: tuple[Trial, ...]
    ) -> tuple[Trial, ...]:
        """Add pairs with those next to the best alone, until one leaves no more than it may."""
        for beginning in first[1:BEGINNINGS]:
            if not pairs or not self._leaves_too_much(pairs[0]):
                break
            if self._pays(None, beginning):
                more = self._tried(self._refined(beginning))
                pairs = tuple(sorted((*pairs, *more), key=cost))
        return pairs

    def _pays(self, kept: Trial | None, more: Trial) -> bool:
        misfit = kept.misfit if kept else self._before
        return misfit - more.misfit >= self._price(kept, more) and certain(more)

    def _refined(self, kept: Trial) -> Trial:
        """Give what is kept its order, and each the form whose parameters tell the most."""
        kept = min((kept, *self._bench.reordered(kept)), key=cost)
        for place, candidate in enumerate(kept.candidates):
            family = candidate.entry.family(candidate.form.kind)
            kept = min((kept, *self._exchanged(kept, place, family)), key=untold)
        return kept

    def _exchanged(self, kept: Trial, place: int, forms: Iterable[EffectForm]) -> Iterator[Trial]:
        for form in forms:
            if form is not kept.candidates[place].form:
                clues = self._clues(kept.without(self._bench.chain, place))
                if trial := self._bench.exchanged(kept, place, form, clues):
                    yield trial

    def _backwards(self, kept: Trial | None) -> Trial | None:
        """Drop what others, found after it, have made needless."""
        while kept and len(kept.candidates) > 1:
            fewer = [(i, self._bench.without(kept, i)) for i in range(len(kept.candidates))]
            pays = {
                i: trial.misfit - kept.misfit - price(kept.candidates[i])
                for i, trial in fewer
                if trial
            }
            least = min(pays, key=pays.__getitem__, default=None)
            if least is None or pays[least] > 0.0:
                break
            kept = fewer[least][1]
        return kept

    def _swapped(self, kept: Trial, first: tuple[Trial, ...]) -> tuple[Trial, Sequence[Place]]:
        """Put into a place what does better there, as long as something does.

        What was found first was fitted to a residual that held the others too. Returns what was
        tried in each place at last as well.
        """
        kept = self._kindred(kept)
        places = self._places(kept, first)
        for _ in range(MOST_EFFECTS):
            tried = [trial for place in places for trial in place.trials]
            best = _likeliest(tried) if tried else kept
            gain = cost(kept) - cost(best)
            if gain < self._price(kept, best) or not certain(best):
                break
            kept = self._kindred(self._refined(self._backwards(best) or best))
            places = self._places(kept, first)
        return kept, places

    def _kindred(self, kept: Trial) -> Trial:
        """Let another form of an effect stand for it, and for what that makes needless."""
        for place in range(len(kept.candidates)):
            others = (self._backwards(trial) for trial in self._bench.kindred(kept, place))
            best = min((trial for trial in others if trial), key=cost, default=kept)
            if cost(best) < cost(kept):
                return best
        return kept

    def _places(self, kept: Trial, first: tuple[Trial, ...]) -> Sequence[Place]:
        """What can stand in the place of each effect that is kept."""
        places: list[Place] = []
        for owner in range(len(kept.candidates)):
            rest = self._bench.without(kept, owner)
            misfit = rest.misfit if rest else self._before
            places.append(Place(misfit, self._tried(rest) if rest else first))
        return places

    def _tried(self, kept: Trial | None) -> tuple[Trial, ...]:
        """Candidates beside those kept, the best first: all begun, the most promising fitted."""
        clues, begun = self._clues(self._reached(kept)), []
        for candidate in CANDIDATES:
            self._told(candidate.entry.name)
            begun.append(self._bench.begin(kept, candidate, clues))
        promising = sorted((b for b in begun if b), key=lambda b: b.cost)[:FITTED]
        trials = (self._bench.fit(beginning) for beginning in promising)
        return tuple(sorted((t for t in trials if t), key=cost))

    def _price(self, kept: Trial | None, trial: Trial) -> float:
        """What a trial must lower the misfit by beside what is kept.

        In each band, what it gains counts for nothing up to a share of what those kept explain.
        """
        *before, one_more = trial.candidates
        akin = any(
            one_more.entry.name in (known.entry.name, *known.entry.confusable) for known in before
        )
        share = PRICE_SHARE_AKIN if akin else PRICE_SHARE
        reached = self._ratios(kept)
        excused = share * lowered(self._ratios(None), reached)
        gained = lowered(reached, self._ratios(trial))
        return float(np.minimum(excused, gained).sum()) + price(one_more)

    def _reached(self, kept: Trial | None) -> Chain:
        return kept.extended(self._bench.chain) if kept else self._bench.chain

    def _leaves_too_much(self, kept: Trial) -> bool:
        return too_much(self._ratios(None), self._ratios(kept))

    def _ratios(self, kept: Trial | None) -> list[Array]:
        chain = self._reached(kept)
        return [each.ratio(chain) for each in self._bench.evidence]

    def _at_floor(self, chain: Chain) -> bool:
        return max(float(e.ratio(chain).max()) for e in self._bench.evidence) < AT_FLOOR


def _likeliest(trials: Sequence[Trial]) -> Trial:
    """Return the best trial; of those nearly as good, the best that is certain.

    A formula of many parameters that can do what a simpler one does leaves open which it is.
    """
    best, *_ = ranked = sorted(trials, key=cost)
    near = (trial for trial in ranked if cost(trial) < cost(best) + MARGIN)
    return next((trial for trial in near if certain(trial)), best)
