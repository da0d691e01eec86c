"""What rings after the turns of a drive → a resonance, the density of the hysteresis being known.

A grid coarse enough for a search over densities has kinks that ring themselves, so the resonance
is sought under the surface of a fine one, sample by sample.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from scipy.stats import t as student

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.identification.joint.cells import CellGrid
from afm_scan_ros.core.identification.joint.moving import Dynamics, MovingRecord
from afm_scan_ros.core.identification.joint.search import (
    LEVEL,
    Evidence,
    Found,
    Lag,
    Resonance,
    parts_of,
    search,
)
from afm_scan_ros.core.types import Array

SAMPLES = 400_000
"""Samples of all records together that are looked at."""
RATIO = 1.06
"""Ratio of neighbouring frequencies that are tried, about as wide as a resonance is."""
SLOWEST, FASTEST = 3.0, 0.25
"""Lowest frequency tried, in swings of the slowest record; highest, in sample rates."""
SEVERAL = 3
"""Records from which on what they disagree by tells the model's error."""
BEST = 3
"""Frequencies tried from which a search begins."""


@frozen(eq=False)
class Followed(Evidence):
    """Records under one density: displacement (m), and F that drives it, from rest."""

    moved: Sequence[Array]
    effective: Sequence[Array]
    first: Sequence[int]
    sample_periods: Sequence[float]

    @classmethod
    def of(
        cls, records: Sequence[MovingRecord], surface: EverettSurface, grid: CellGrid
    ) -> "Followed":
        """Follow a surface along the drives."""
        share = SAMPLES // len(records)
        model, kept = Preisach(surface), [record.cut(share) for record in records]
        rest = model.at_rest()
        effective = [model.apply(rest, record.drive)[1] - rest.now[1] for record in kept]
        moved, periods = zip(*((r.displacement, r.sample_period) for r in kept), strict=True)
        first = [record.known_from(grid.lower, grid.upper) for record in kept]
        return cls(moved, effective, first, periods)

    def residual(self, dynamics: Dynamics) -> Array:
        """What the best gain leaves; each record has an origin of its own."""
        shown, moved = zip(*(self._shown(k, dynamics) for k in range(len(self.moved))), strict=True)
        given, found = np.concatenate(shown), np.concatenate(moved)
        gain = (given @ found) / (given @ given)
        return np.asarray((found - gain * given) / np.sqrt(found @ found))

    def _shown(self, number: int, dynamics: Dynamics) -> tuple[Array, Array]:
        period, taught = self.sample_periods[number], slice(self.first[number], None)
        chain = Cascade((Vibration(dynamics.vibration, period), Creep(dynamics.creep, period)))
        shown = chain.apply(chain.at_rest(), self.effective[number])[1][taught]
        moved = self.moved[number][taught]
        return shown - shown.mean(), moved - moved.mean()

    def pieces(self) -> Sequence[slice]:
        """Parts of each record, counted through all."""
        lengths = [len(m) - first for m, first in zip(self.moved, self.first, strict=True)]
        return parts_of(lengths)

    def motions(self) -> Sequence[slice]:
        """Records, where they are several: what a density misses recurs at every turn of one."""
        lengths = [len(m) - first for m, first in zip(self.moved, self.first, strict=True)]
        ends = np.cumsum(lengths).tolist()
        if len(ends) < SEVERAL:
            return self.pieces()
        return [slice(end - length, end) for end, length in zip(ends, lengths, strict=True)]


def resonance(
    records: Sequence[MovingRecord], evidence: Followed, before: Dynamics
) -> Found | None:
    """Seek a resonance and the lag beside it; None where the records do not tell one."""
    slowest = min(record.swings for record in records)
    highest = FASTEST / min(evidence.sample_periods)
    if highest <= RATIO * SLOWEST * slowest:
        return None
    tried = np.geomspace(
        SLOWEST * slowest,
        highest,
        max(2, int(np.log(highest / (SLOWEST * slowest)) / np.log(RATIO))),
    )
    forms = [Resonance(tried, float(frequency)) for frequency in tried]
    left = [
        float(np.linalg.norm(evidence.residual(form.put(before, form.bounds[1])))) for form in forms
    ]
    lag = Lag(records)
    found = [search(evidence, before, [lag, forms[place]]) for place in np.argsort(left)[:BEST]]
    best = min(found, key=lambda each: float(np.linalg.norm(each.residual)))
    return best if all(best.told) and _better(evidence, before, best.dynamics) else None


def _better(evidence: Followed, before: Dynamics, after: Dynamics) -> bool:
    """Whether dynamics leave less of nearly all pieces, by a one-sided t-test."""
    old, new = (evidence.residual(each) ** 2 for each in (before, after))
    gained = np.array([np.sum(old[part] - new[part]) for part in evidence.pieces()])
    error = gained.std(ddof=1) / np.sqrt(len(gained))
    return bool(gained.mean() > student.ppf(LEVEL, len(gained) - 1) * error)
