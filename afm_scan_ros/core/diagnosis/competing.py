"""Effects that, in the place of one selected, lower the misfit nearly as well.

Forms of one effect told apart by all of the records, from the rest on; and those that are not.

A bend of the sensor and one of the drive do the same to a raster but for where its middle comes to
lie: stretches without their mean hardly tell them apart, and an inverse that bends the one for the
other leads astray. What was recorded from the rest on tells more. Of forms that it does not tell
apart either the likelier is taken: with the wrong one a scanner errs by as much as their motions
differ, whichever that is. Where this matters it is said.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import (
    Candidate,
    CandidateFitter,
    FittedCandidates,
    refit_on_all,
)
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.scoring import reduces_to_simpler, undetermined_misfit
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array

MARGIN, MARGIN_SHARE, MARGIN_MOST = 2.0, 1.5, 0.5
"""A rival's misfit is no more than this above the best's, and this times what the best leaves above
its floor; but at most the last share of what the one that it stands for explains."""
HEALTHY = 0.75
"""Mean square of a band's ratio to its floor where nothing is missing."""


@frozen(eq=False)
class CompetingModel:
    """A trial in which ``candidate`` stands for the ``place``-th effect that was selected."""

    place: int
    candidate: Candidate
    trial: FittedCandidates


@frozen(eq=False)
class Replacements:
    """Misfit with the place of an effect left empty, and the trials of others in it."""

    misfit: float
    trials: tuple[FittedCandidates, ...]


def competing_models(
    selected: FittedCandidates, places: Sequence[Replacements], bands: int
) -> Iterator[CompetingModel]:
    """Yield those that records of so many bands, all together, do not tell from an effect kept."""
    margin = MARGIN + MARGIN_SHARE * max(selected.misfit - HEALTHY * bands, 0.0)
    for number, (owner, place) in enumerate(zip(selected.candidates, places, strict=True)):
        own = place.misfit - selected.misfit
        reached = selected.misfit + min(margin, MARGIN_MOST * own)
        for trial in place.trials:
            stands = trial.candidates[-1]
            other = stands.effect.name != owner.effect.name
            if other and trial.misfit < reached and not reduces_to_simpler(trial, owner):
                yield CompetingModel(number, stands, trial)


DISTINCT = 0.83
"""Motion by which two forms differ over what the better one leaves, from which on it matters which
is right: the error of the wrong one is 1.3 times as large."""

Exchange = Callable[[FittedCandidates, int, Iterable[EffectForm]], Iterator[FittedCandidates]]
"""Gives what is kept with each of some forms in a place."""


@frozen(eq=False)
class EquivalentForm:
    """Another form that does as well as the one kept, and rms (m) by which its motion differs.

    Both are of a scan's lines; ``left`` (m) is what the one kept leaves there.
    """

    competing: CompetingModel
    rms: float
    left: float

    @property
    def matters(self) -> bool:
        """Whether the wrong one of the two would show."""
        return self.rms > DISTINCT * self.left


def distinguish_forms(
    bench: CandidateFitter, selected: FittedCandidates, with_form: Exchange
) -> tuple[FittedCandidates, tuple[EquivalentForm, ...]]:
    """Give each effect kept the form that the whole of the records tells, and those like it.

    An effect that no feedforward undoes is left as it is: its form moves no scanner.
    """
    equivalent: list[EquivalentForm] = []
    for place, candidate in enumerate(selected.candidates):
        if candidate.effect.remedy != "none":
            others = with_form(selected, place, candidate.effect.forms)
            near = [
                trial
                for trial in others
                if undetermined_misfit(trial) < undetermined_misfit(selected) + MARGIN
            ]
            selected, found = _best(bench, place, [selected, *near]) if near else (selected, ())
            equivalent += found
    return selected, tuple(equivalent)


def _best(
    bench: CandidateFitter, place: int, near: Sequence[FittedCandidates]
) -> tuple[FittedCandidates, Iterable[EquivalentForm]]:
    """Return the best of several forms in a place, and those that it cannot be told from."""
    wholes = {trial: _whole(bench, trial) for trial in near}
    best = min(near, key=lambda trial: undetermined_misfit(wholes[trial]))
    whole = wholes.pop(best)
    chain = whole.extended(bench.chain)
    return best, [
        _equivalent(bench, chain, CompetingModel(place, trial.candidates[place], trial), other)
        for trial, other in wholes.items()
        if other.misfit < whole.misfit + MARGIN
        and undetermined_misfit(other) < undetermined_misfit(whole) + MARGIN
    ]


def _whole(bench: CandidateFitter, trial: FittedCandidates) -> FittedCandidates:
    """Refit to all samples, with the misfit on all samples from the initial rest on."""
    found = refit_on_all(bench.evidence, bench.chain, trial)
    chain = found.extended(bench.chain)
    misfit = sum(float(np.mean(each.whole(chain) ** 2)) for each in bench.evidence)
    return evolve(found, misfit=misfit)


def _equivalent(
    bench: CandidateFitter, best: Chain, competing: CompetingModel, whole: FittedCandidates
) -> EquivalentForm:
    """Compare in the record where it matters most."""
    other = whole.extended(bench.chain)
    found = [EquivalentForm(competing, *_compared(each, best, other)) for each in bench.evidence]
    return max(found, key=lambda equivalent: equivalent.rms - DISTINCT * equivalent.left)


def _compared(evidence: Evidence, best: Chain, other: Chain) -> tuple[float, float]:
    """Rms (m) by which the motions of two chains differ, and of what the first leaves."""
    left, otherwise = (evidence.left(chain) for chain in (best, other))
    return _rms(left - otherwise), _rms(left)


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
