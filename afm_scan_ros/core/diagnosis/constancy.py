"""Effects that are not there in equal measure wherever the records should show them.

What is none of the catalogue's may be bent to fit one part of a record at another's cost: a gain
that fades passes for one that is smaller, y² for x² as long as both axes move together. So an
effect may have an amount of its own in each part, and what that gains is held against chance:
Chow's test for a change of coefficients (Econometrica 28, 1960, 591).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import CONFIDENT, SYSTEMATIC
from afm_scan_ros.core.diagnosis.trial import Trial
from afm_scan_ros.core.types import Array

PARTS = 4
"""Of a record, in time: of a scan, the first ones prepare it."""
UNLIKE = 0.05
"""Share of what an effect does that may change from part to part, its amount by a fifth: a formula
is not quite the physics."""


def inconstant(evidence: Sequence[Evidence], chain: Chain, kept: Trial) -> Iterator[int]:
    """Yield the places of the effects of which the amount changes by more than chance explains."""
    left = [each.excess(kept.extended(chain)) for each in evidence]
    for place in range(len(kept.candidates)):
        less = kept.without(chain, place)
        taken = [each.excess(less) - rest for each, rest in zip(evidence, left, strict=True)]
        parts = [part for pair in zip(taken, left, strict=True) for part in _parts(*pair)]
        gained = sum(_explained(part) for part in parts) - _explained(np.hstack(parts))
        allowed = CONFIDENT**2 * SYSTEMATIC * len(evidence) + UNLIKE * _power(taken)
        if gained > allowed:
            yield place


def _parts(taken: Array, left: Array) -> list[Array]:
    """Parts (2, m) of what an effect takes of a record's excess and what is left, both (n,)."""
    return np.array_split(np.stack((taken, left)) / np.sqrt(len(left)), PARTS, axis=1)


def _explained(part: Array) -> float:
    """What more or less of the effect explains of what is left, squared.

    It is expected to change by no more than its own amount (ridge regression): where hardly any of
    it is seen, another amount explains nothing.
    """
    taken, left = part
    return float(taken @ left) ** 2 / (float(taken @ taken) + SYSTEMATIC)


def _power(taken: Sequence[Array]) -> float:
    return sum(float(np.mean(each**2)) for each in taken)
