"""Tests whether an effect is constant over the records, and whether it is synchronous.

A mechanism outside the catalogue may be fitted by an effect in one part of a record at the cost of
another. So each part may have its own amount of the effect, and the gain is compared with chance:
Chow's test for a change of coefficients (Econometrica 28, 1960, 591).

The model's own error of a periodic motion lies at multiples of its repetition rate. A disturbance
within one over the record's length of such a multiple (Rayleigh) cannot be distinguished from it,
unless another record shows it whose drive does not repeat at this rate.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import CONFIDENT
from afm_scan_ros.core.diagnosis.likelihood import FREEDOM, TYPICAL_SHARE
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array

ALONG = TYPICAL_SHARE / FREEDOM
"""Power of a healthy residual along one influence, in detection limits squared."""
TIME_PARTS = 4
"""Parts of a record in time."""
LARGEST_CHANGE = 0.05
"""Share of an effect's power that may change from part to part, a fifth of its amount: a formula
approximates the physics."""


def time_varying(
    evidence: Sequence[Evidence], chain: Chain, selected: FittedCandidates
) -> Iterator[int]:
    """Yield the places of the effects whose amount changes by more than chance explains."""
    left = [each.normalised_residual(selected.extended(chain)) for each in evidence]
    for place in range(len(selected.candidates)):
        less = selected.without(chain, place)
        taken = [
            each.normalised_residual(less) - rest for each, rest in zip(evidence, left, strict=True)
        ]
        parts = [part for pair in zip(taken, left, strict=True) for part in _time_parts(*pair)]
        gained = sum(_explained_power(part) for part in parts) - _explained_power(np.hstack(parts))
        allowed = CONFIDENT**2 * ALONG * len(evidence) + LARGEST_CHANGE * _power(taken)
        if gained > allowed:
            yield place


def _time_parts(taken: Array, left: Array) -> list[Array]:
    """Parts (2, m) of what an effect explains of a record and of what is left, both (n,)."""
    return np.array_split(np.stack((taken, left)) / np.sqrt(len(left)), TIME_PARTS, axis=1)


def _explained_power(part: Array) -> float:
    """Power of what is left that another amount of the effect explains.

    A ridge term assumes changes no larger than the amount itself, so an effect that is hardly
    excited in a part explains nothing there.
    """
    taken, left = part
    return float(taken @ left) ** 2 / (float(taken @ taken) + ALONG)


def _power(taken: Sequence[Array]) -> float:
    return sum(float(np.mean(each**2)) for each in taken)


COMPARABLE = 0.5
"""Share of the largest amplitude of any tone in any record above which a tone counts as present:
an asynchronous disturbance is equally large in every record."""


def synchronous_places(selected: FittedCandidates, evidence: Sequence[Evidence]) -> Iterator[int]:
    """Yield the places of the disturbances that are synchronous with the drive in every record."""
    views = [each.playback.view for each in evidence]
    for place, candidate in enumerate(selected.candidates):
        if any(parameter.located for parameter in candidate.form.parameters):
            rate, sizes = _drive_tones(candidate.form, selected.fit.rows[:, selected.part(place)])
            seen = np.argwhere(sizes >= COMPARABLE * sizes.max())
            if all(repeats(views[record], (k + 1) * rate) for record, k in seen):
                yield place


def _drive_tones(form: EffectForm, rows: Array) -> tuple[float, Array]:
    """Frequency (Hz) of the first harmonic, and the size of each in each record (r, harmonics)."""
    rate = rows[0, [p.name for p in form.parameters].index("frequency")]
    amounts = rows[:, [p.own for p in form.parameters]].reshape(len(rows), -1, 2)
    return float(rate), np.linalg.norm(amounts, axis=2)


def repeats(view: AxisSignals, frequency: float) -> bool:
    """Whether the drive of a record repeats at a frequency, or at one that divides it."""
    if not view.rates:
        return False
    rates = np.array(view.rates)
    multiple = np.maximum(np.round(frequency / rates), 1.0)
    return bool(np.any(np.abs(frequency - multiple * rates) < 1.0 / view.duration))
