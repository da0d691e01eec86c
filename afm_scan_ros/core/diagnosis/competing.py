"""Competing models: other effects, and other forms of an effect, that fit nearly as well.

Forms are compared on all samples from the scanner's rest on, not on stretches about their mean. A
nonlinearity of the sensor and one of the drive, for example, differ on a raster mainly in the
position of its centre. Among forms that remain equivalent the likelier is taken. With the wrong
one the error is the difference of their motions; where this matters, the verdict is ambiguous.
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
"""A competing model's misfit exceeds the best by at most ``MARGIN``, plus ``MARGIN_SHARE`` times
what the best leaves above the detection limit. The excess is at most ``MARGIN_MOST`` times what the
replaced effect explains."""
HEALTHY = 0.75
"""Mean square of a band's ratio to its detection limit for a sufficient model."""


@frozen(eq=False)
class CompetingModel:
    """A trial with ``candidate`` in the place of a selected effect."""

    place: int
    candidate: Candidate
    trial: FittedCandidates


@frozen(eq=False)
class Replacements:
    """Misfit without an effect, and the trials of others in its place."""

    misfit: float
    trials: tuple[FittedCandidates, ...]


def competing_models(
    selected: FittedCandidates, places: Sequence[Replacements], bands: int
) -> Iterator[CompetingModel]:
    """Yield the trials that cannot be distinguished from a selected effect.

    ``bands`` is the number of bands of all records.
    """
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
"""Difference of two forms' motions, over the residual of the better one, above which the choice
matters: the error with the wrong form is 1.3 times as large."""

Exchange = Callable[[FittedCandidates, int, Iterable[EffectForm]], Iterator[FittedCandidates]]
"""Yields the selected candidates with each of some forms in a place."""


@frozen(eq=False)
class EquivalentForm:
    """A form that fits as well as the selected one, and the rms (m) difference of their motions.

    ``left`` (m) is the rms residual of the selected form. Both are of a scan's lines.
    """

    competing: CompetingModel
    rms: float
    left: float

    @property
    def matters(self) -> bool:
        """Whether choosing the wrong form would change the error noticeably."""
        return self.rms > DISTINCT * self.left


def distinguish_forms(
    bench: CandidateFitter, selected: FittedCandidates, with_form: Exchange
) -> tuple[FittedCandidates, tuple[EquivalentForm, ...]]:
    """Choose the form of each selected effect on whole records; return equivalent forms too.

    An effect without a feedforward remedy keeps its form, because the form changes no drive.
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
    """Return the best of several forms in a place, and those equivalent to it."""
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
    """Compare two forms in the record where the choice matters most."""
    other = whole.extended(bench.chain)
    found = [EquivalentForm(competing, *_compared(each, best, other)) for each in bench.evidence]
    return max(found, key=lambda equivalent: equivalent.rms - DISTINCT * equivalent.left)


def _compared(evidence: Evidence, best: Chain, other: Chain) -> tuple[float, float]:
    """Rms difference (m) of the motions of two chains, and rms residual (m) of the first."""
    left, otherwise = (evidence.left(chain) for chain in (best, other))
    return _rms(left - otherwise), _rms(left)


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
