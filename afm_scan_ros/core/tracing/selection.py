"""Effects selected on one axis: forwards while one pays, backwards where one has ceased to.

Misfits count a band at its floor as 1. An effect must lower the misfit on what tests by a price:
for being one more, for each of its parameters, and for the number of candidates tried. Rivals
are those that, in the place of one selected, do so nearly as well.
"""

from collections.abc import Callable, Iterator, Sequence

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.tracing.trial import CANDIDATES, Bench, Candidate, Trial
from afm_scan_ros.core.tracing.worth import certain, cost, imitates, price, untold

PRICE_SHARE, PRICE_SHARE_AKIN = 0.02, 0.1
"""Of what those before it explain: a formula is not quite the physics, and what it leaves looks
like an effect that it can be mistaken for."""
MARGIN, MARGIN_SHARE, MARGIN_MOST = 2.0, 1.5, 0.5
"""A rival's misfit is no more than this above the best's, and this times what the best leaves above
its floor; but at most the last share of what the one that it stands for explains."""
HEALTHY = 0.75
"""Mean square of a band's ratio to its floor where nothing is missing."""
MOST_EFFECTS = 3
AT_FLOOR = 1.8
"""Largest ratio of a band's rms to its floor at which the search ends: nothing is missing."""

FITTED = 6
"""Of the candidates begun, those that are fitted to the end."""

Told = Callable[[str], None]


@frozen(eq=False)
class Rival:
    """A trial in which ``candidate`` stands for the ``place``-th effect that was selected."""

    place: int
    candidate: Candidate
    trial: Trial


@frozen(eq=False)
class Selection:
    """What was selected on one axis. ``misfit_before`` is that of the bare model.

    ``first`` holds all candidates tried alone, the best first; ``rivals`` those that cannot be
    told from one selected.
    """

    misfit_before: float
    kept: Trial | None
    rivals: tuple[Rival, ...]
    first: tuple[Trial, ...]

    @property
    def misfit_after(self) -> float:
        """Misfit with all that was selected."""
        return self.kept.misfit if self.kept else self.misfit_before


@frozen(eq=False)
class _Place:
    """Misfit with the place of an effect left empty, and the trials of others in it."""

    misfit: float
    trials: tuple[Trial, ...]


class Selector:
    """Selects effects on one axis; ``told`` hears what is tried.

    ``clues`` gives what is seen of the residual that a chain leaves.
    """

    def __init__(self, bench: Bench, clues: Callable[[Chain], Clues], told: Told) -> None:
        self._bench, self._clues, self._told = bench, clues, told
        self._before = bench.misfit(bench.chain)

    def select(self) -> Selection:
        """Select the effects that the records show."""
        kept, first = self._forwards()
        rivals: tuple[Rival, ...] = ()
        if kept := self._backwards(kept):
            kept, places = self._swapped(kept, first)
            rivals = tuple(self._rivals(kept, places))
        return Selection(self._before, kept, rivals, first)

    def _forwards(self) -> tuple[Trial | None, tuple[Trial, ...]]:
        kept: Trial | None = None
        first: tuple[Trial, ...] = ()
        while kept is None or len(kept.candidates) < MOST_EFFECTS:
            if self._at_floor(self._reached(kept)):
                break
            trials = self._tried(kept)
            first = first or trials
            misfit = kept.misfit if kept else self._before
            if not trials or misfit - trials[0].misfit < self._price(trials[0], misfit):
                break
            if not certain(trials[0]):
                break
            kept = self._refined(trials[0])
        return kept, first

    def _refined(self, kept: Trial) -> Trial:
        """Give each that is kept the form of its family whose parameters tell the most."""
        for place in range(len(kept.candidates)):
            kept = min((kept, *self._exchanged(kept, place)), key=untold)
        return kept

    def _exchanged(self, kept: Trial, place: int) -> Iterator[Trial]:
        candidate = kept.candidates[place]
        for form in candidate.entry.family(candidate.form.kind):
            if form is not candidate.form:
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

    def _swapped(self, kept: Trial, first: tuple[Trial, ...]) -> tuple[Trial, Sequence[_Place]]:
        """Put into a place what does better there, as long as something does.

        What was found first was fitted to a residual that held the others too. Returns what was
        tried in each place at last as well.
        """
        kept = self._kindred(kept)
        places = self._places(kept, first)
        for _ in range(MOST_EFFECTS):
            tried = (trial for place in places for trial in place.trials)
            best = min(tried, key=cost, default=kept)
            gain = cost(kept) - cost(best)
            if gain < self._price(best, kept.misfit) or not certain(best):
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

    def _places(self, kept: Trial, first: tuple[Trial, ...]) -> Sequence[_Place]:
        """What can stand in the place of each effect that is kept."""
        places: list[_Place] = []
        for owner in range(len(kept.candidates)):
            rest = self._bench.without(kept, owner)
            misfit = rest.misfit if rest else self._before
            places.append(_Place(misfit, self._tried(rest) if rest else first))
        return places

    def _rivals(self, kept: Trial, places: Sequence[_Place]) -> Iterator[Rival]:
        margin = MARGIN + MARGIN_SHARE * max(kept.misfit - self._healthy(), 0.0)
        for number, (owner, place) in enumerate(zip(kept.candidates, places, strict=True)):
            own = place.misfit - kept.misfit
            reached = kept.misfit + min(margin, MARGIN_MOST * own)
            for trial in place.trials:
                stands = trial.candidates[-1]
                other = stands.entry.name != owner.entry.name
                if other and trial.misfit < reached and not imitates(trial, owner):
                    yield Rival(number, stands, trial)

    def _tried(self, kept: Trial | None) -> tuple[Trial, ...]:
        """Candidates beside those kept, the best first: all begun, the most promising fitted."""
        clues, begun = self._clues(self._reached(kept)), []
        for candidate in CANDIDATES:
            self._told(candidate.entry.name)
            begun.append(self._bench.begin(kept, candidate, clues))
        promising = sorted((b for b in begun if b), key=lambda b: b.cost)[:FITTED]
        trials = (self._bench.fit(beginning) for beginning in promising)
        return tuple(sorted((t for t in trials if t), key=cost))

    def _price(self, trial: Trial, misfit: float) -> float:
        *before, one_more = trial.candidates
        akin = any(
            one_more.entry.name in (known.entry.name, *known.entry.confusable) for known in before
        )
        share = PRICE_SHARE_AKIN if akin else PRICE_SHARE
        return share * (self._before - misfit) + price(one_more)

    def _reached(self, kept: Trial | None) -> Chain:
        return kept.extended(self._bench.chain) if kept else self._bench.chain

    def _healthy(self) -> float:
        return HEALTHY * sum(len(each.floor.rms) for each in self._bench.evidence)

    def _at_floor(self, chain: Chain) -> bool:
        return max(float(e.ratio(chain).max()) for e in self._bench.evidence) < AT_FLOOR
