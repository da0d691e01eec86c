"""Effects selected on one axis: forwards while one pays, backwards where one has ceased to.

Misfits count a band at its floor as 1. An effect must lower the misfit on what tests by a price:
for being one more, for each of its parameters, and for the number of candidates tried. Rivals
are those that, in the place of one selected, do so nearly as well.
"""

import math
from collections.abc import Callable, Sequence

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.tracing.evidence import Evidence, misfit
from afm_scan_ros.core.tracing.trial import CANDIDATES, Candidate, Trial, try_with, try_without

PRICE_OF_ONE, PRICE_OF_PARAMETER = 2.0, 0.25
MARGIN, MARGIN_SHARE = 2.0, 0.1
"""A rival's misfit is no more than this, and this share of what is explained, above the best's."""
MOST_EFFECTS = 3
AT_FLOOR = 1.6
"""Largest ratio of a band's rms to its floor at which the search ends: nothing is missing."""

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


def select(
    evidence: Sequence[Evidence], chain: Chain, clues: Callable[[Chain], Clues], told: Told
) -> Selection:
    """Select the effects that the records of one axis show; ``told`` hears what is tried."""
    before = misfit(evidence, chain, taught=False)
    kept: Trial | None = None
    first: tuple[Trial, ...] = ()
    while kept is None or len(kept.candidates) < MOST_EFFECTS:
        reached_chain = kept.extended(chain) if kept else chain
        if max(float(each.ratio(reached_chain).max()) for each in evidence) < AT_FLOOR:
            break
        seen = clues(reached_chain)
        trials = _all_tried(evidence, chain, kept, seen, told)
        first = first or trials
        reached = kept.misfit if kept else before
        if not trials or reached - trials[0].misfit < price(trials[0].candidates[-1]):
            break
        kept = trials[0]
    kept = _without_needless(evidence, chain, kept)
    rivals = _rivals(evidence, chain, kept, before, clues, told) if kept else ()
    return Selection(before, kept, rivals, first)


def price(candidate: Candidate) -> float:
    """What an effect must lower the misfit by."""
    parameters = len(candidate.form.parameters)
    return PRICE_OF_ONE + PRICE_OF_PARAMETER * (parameters + math.log(len(CANDIDATES)))


def _all_tried(
    evidence: Sequence[Evidence], chain: Chain, kept: Trial | None, clues: Clues, told: Told
) -> tuple[Trial, ...]:
    trials = []
    for candidate in CANDIDATES:
        told(candidate.entry.name)
        if kept and candidate.entry.name in kept.names:
            continue
        trial = try_with(evidence, chain, kept, candidate, clues)
        if trial:
            trials.append(trial)
    return tuple(sorted(trials, key=lambda trial: trial.misfit))


def _without_needless(
    evidence: Sequence[Evidence], chain: Chain, kept: Trial | None
) -> Trial | None:
    while kept and len(kept.candidates) > 1:
        fewer = [try_without(evidence, chain, kept, i) for i in range(len(kept.candidates))]
        costs = [
            (trial.misfit - kept.misfit - price(kept.candidates[i]), i)
            for i, trial in enumerate(fewer)
            if trial
        ]
        cheapest, place = min(costs)
        if cheapest > 0.0:
            break
        kept = fewer[place]
    return kept


def _rivals(
    evidence: Sequence[Evidence],
    chain: Chain,
    kept: Trial,
    before: float,
    clues: Callable[[Chain], Clues],
    told: Told,
) -> tuple[Rival, ...]:
    margin = MARGIN + MARGIN_SHARE * (before - kept.misfit)
    rivals = []
    for place, owner in enumerate(kept.candidates):
        rest = try_without(evidence, chain, kept, place)
        seen = clues(rest.extended(chain) if rest else chain)
        for trial in _all_tried(evidence, chain, rest, seen, told):
            stands = trial.candidates[-1]
            if stands.entry.name != owner.entry.name and trial.misfit < kept.misfit + margin:
                rivals.append(Rival(place, stands, trial))
    return tuple(rivals)
