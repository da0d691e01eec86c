"""Periodic disturbances that are in step with the drive, and so may be none.

What a model leaves of a motion that repeats stands at multiples of the rate at which it repeats. A
disturbance of time there cannot be told from it, nor within one over the record's length of there
(Rayleigh), unless another record, of which the drive repeats otherwise or not at all, holds it too.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.tracing.evidence import Evidence
from afm_scan_ros.core.tracing.observation import View
from afm_scan_ros.core.tracing.trial import Trial

DISTURBANCE = "periodic_disturbance"
AS_LARGE = 0.5
"""Share of its largest amplitude that a disturbance of time has in any record."""


def in_step(kept: Trial, evidence: Sequence[Evidence]) -> Iterator[int]:
    """Yield the places of the disturbances that no record shows out of step with its drive."""
    for place, candidate in enumerate(kept.candidates):
        if candidate.entry.name == DISTURBANCE:
            rows = kept.fit.rows[:, kept.part(place)]
            size = np.hypot(rows[:, 0], rows[:, 1])
            seen = size >= AS_LARGE * size.max()
            shared = (
                repeats(e.playback.view, row[2]) for e, row in zip(evidence, rows, strict=True)
            )
            if all(~seen | np.array(list(shared))):
                yield place


def repeats(view: View, frequency: float) -> bool:
    """Whether the drive of a record repeats at a frequency, or at one that divides it."""
    if not view.rates:
        return False
    rates = np.array(view.rates)
    multiple = np.maximum(np.round(frequency / rates), 1.0)
    return bool(np.any(np.abs(frequency - multiple * rates) < 1.0 / view.duration))
