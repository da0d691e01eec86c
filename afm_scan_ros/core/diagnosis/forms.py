"""Forms of one effect told apart by all of the records, from the rest on; and those that are not.

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
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.rivals import MARGIN, Rival
from afm_scan_ros.core.diagnosis.settling import settled
from afm_scan_ros.core.diagnosis.trial import Bench, Trial
from afm_scan_ros.core.diagnosis.worth import untold
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array

APART = 0.83
"""Motion by which two forms differ over what the better one leaves, from which on it matters which
is right: the error of the wrong one is 1.3 times as large."""

Exchanged = Callable[[Trial, int, Iterable[EffectForm]], Iterator[Trial]]
"""Gives what is kept with each of some forms in a place."""


@frozen(eq=False)
class Alike:
    """Another form that does as well as the one kept, and rms (m) by which its motion differs.

    Both are of a scan's lines; ``left`` (m) is what the one kept leaves there.
    """

    rival: Rival
    rms: float
    left: float

    @property
    def matters(self) -> bool:
        """Whether the wrong one of the two would show."""
        return self.rms > APART * self.left


def told_apart(bench: Bench, kept: Trial, exchanged: Exchanged) -> tuple[Trial, tuple[Alike, ...]]:
    """Give each effect kept the form that the whole of the records tells, and those like it.

    An effect that no feedforward undoes is left as it is: its form moves no scanner.
    """
    alike: list[Alike] = []
    for place, candidate in enumerate(kept.candidates):
        if candidate.entry.remedy != "none":
            others = exchanged(kept, place, candidate.entry.forms)
            near = [trial for trial in others if untold(trial) < untold(kept) + MARGIN]
            kept, found = _best(bench, place, [kept, *near]) if near else (kept, ())
            alike += found
    return kept, tuple(alike)


def _best(bench: Bench, place: int, near: Sequence[Trial]) -> tuple[Trial, Iterable[Alike]]:
    """Return the best of several forms in a place, and those that it cannot be told from."""
    wholes = {trial: _whole(bench, trial) for trial in near}
    best = min(near, key=lambda trial: untold(wholes[trial]))
    whole = wholes.pop(best)
    chain = whole.extended(bench.chain)
    return best, [
        _alike(bench, chain, Rival(place, trial.candidates[place], trial), other)
        for trial, other in wholes.items()
        if other.misfit < whole.misfit + MARGIN and untold(other) < untold(whole) + MARGIN
    ]


def _whole(bench: Bench, trial: Trial) -> Trial:
    """Trial settled, with the misfit that it leaves of all of the records, from the rest on."""
    found = settled(bench.evidence, bench.chain, trial)
    chain = found.extended(bench.chain)
    misfit = sum(float(np.mean(each.whole(chain) ** 2)) for each in bench.evidence)
    return evolve(found, misfit=misfit)


def _alike(bench: Bench, best: Chain, rival: Rival, whole: Trial) -> Alike:
    """Compare in the record where it matters most."""
    other = whole.extended(bench.chain)
    found = [Alike(rival, *_compared(each, best, other)) for each in bench.evidence]
    return max(found, key=lambda alike: alike.rms - APART * alike.left)


def _compared(evidence: Evidence, best: Chain, other: Chain) -> tuple[float, float]:
    """Rms (m) by which the motions of two chains differ, and of what the first leaves."""
    left, otherwise = (evidence.left(chain) for chain in (best, other))
    return _rms(left - otherwise), _rms(left)


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
