"""Periodic disturbances that are in step with the drive, and so may be none.

What a model leaves of a motion that repeats stands at multiples of the rate at which it repeats. A
disturbance of time there cannot be told from it, nor within one over the record's length of there
(Rayleigh), unless another record, of which the drive repeats otherwise or not at all, holds it too.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.observation import View
from afm_scan_ros.core.diagnosis.trial import Trial
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array

DISTURBANCE = "periodic_disturbance"
AS_LARGE = 0.5
"""Share of the largest amplitude, of any tone in any record, from which on a tone counts as seen: a
disturbance of time is as large in every record."""


def in_step(kept: Trial, evidence: Sequence[Evidence]) -> Iterator[int]:
    """Yield the places of the disturbances that no record shows out of step with its drive."""
    views = [each.playback.view for each in evidence]
    for place, candidate in enumerate(kept.candidates):
        if candidate.entry.name == DISTURBANCE:
            rate, sizes = _tones(candidate.form, kept.fit.rows[:, kept.part(place)])
            seen = np.argwhere(sizes >= AS_LARGE * sizes.max())
            if all(repeats(views[record], (k + 1) * rate) for record, k in seen):
                yield place


def _tones(form: EffectForm, rows: Array) -> tuple[float, Array]:
    """Frequency (Hz) of the first harmonic, and the size of each in each record (r, harmonics)."""
    rate = rows[0, [p.name for p in form.parameters].index("frequency")]
    amounts = rows[:, [p.own for p in form.parameters]].reshape(len(rows), -1, 2)
    return float(rate), np.linalg.norm(amounts, axis=2)


def repeats(view: View, frequency: float) -> bool:
    """Whether the drive of a record repeats at a frequency, or at one that divides it."""
    if not view.rates:
        return False
    rates = np.array(view.rates)
    multiple = np.maximum(np.round(frequency / rates), 1.0)
    return bool(np.any(np.abs(frequency - multiple * rates) < 1.0 / view.duration))
