"""Effects that, in the place of one selected, lower the misfit nearly as well."""

from collections.abc import Iterator, Sequence

from attrs import frozen

from afm_scan_ros.core.diagnosis.trial import Candidate, Trial
from afm_scan_ros.core.diagnosis.worth import imitates

MARGIN, MARGIN_SHARE, MARGIN_MOST = 2.0, 1.5, 0.5
"""A rival's misfit is no more than this above the best's, and this times what the best leaves above
its floor; but at most the last share of what the one that it stands for explains."""
HEALTHY = 0.75
"""Mean square of a band's ratio to its floor where nothing is missing."""


@frozen(eq=False)
class Rival:
    """A trial in which ``candidate`` stands for the ``place``-th effect that was selected."""

    place: int
    candidate: Candidate
    trial: Trial


@frozen(eq=False)
class Place:
    """Misfit with the place of an effect left empty, and the trials of others in it."""

    misfit: float
    trials: tuple[Trial, ...]


def rivals(kept: Trial, places: Sequence[Place], bands: int) -> Iterator[Rival]:
    """Yield those that records of so many bands, all together, do not tell from an effect kept."""
    margin = MARGIN + MARGIN_SHARE * max(kept.misfit - HEALTHY * bands, 0.0)
    for number, (owner, place) in enumerate(zip(kept.candidates, places, strict=True)):
        own = place.misfit - kept.misfit
        reached = kept.misfit + min(margin, MARGIN_MOST * own)
        for trial in place.trials:
            stands = trial.candidates[-1]
            other = stands.entry.name != owner.entry.name
            if other and trial.misfit < reached and not imitates(trial, owner):
                yield Rival(number, stands, trial)
