"""Whether the records are of one scanner, and what each shows against the model of them all."""

from collections.abc import Iterator, Sequence

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import AxisRecord, strongest_waves
from afm_scan_ros.core.identification.findings import (
    CreepGainMismatch,
    Finding,
    SaturatedRecord,
    SingleWave,
    UnfinishedRecord,
    ValidationMismatch,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ReversalCurves,
    can_judge,
)
from afm_scan_ros.core.identification.records.motion import shortfalls
from afm_scan_ros.core.identification.validation import PREDICTED, Validation
from afm_scan_ros.core.identification.vibration.frequency_response import is_sweep
from afm_scan_ros.core.identification.vibration.spectra import (
    RecordSpectra,
    is_periodic,
    repetition,
    response_matrix,
)
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array

LIKE_GAINS = (0.5, 2.0)
"""Gain of the frequency over that of the hysteresis record, beyond which they are not of one."""


class UnlikeRecordsError(InputError):
    """Records of one axis that, fitted in turns, seem to be of two scanners."""


def loops_after(hysteresis: AxisRecord, curves: ReversalCurves) -> bool:
    """Whether loops follow the reversal curves, to judge the fit by."""
    return can_judge(hysteresis.drive[curves.end :])


def refuse_unlike(creep: AxisRecord, frequency: AxisRecord, hysteresis: AxisRecord) -> None:
    """Refuse records of unlike drives.

    Raises UnlikeRecordsError, which names the record and what to record instead.
    """
    within = np.abs(hysteresis.drive).max()
    for name, record in (("creep", creep), ("frequency", frequency)):
        asked = np.abs(record.drive).max()
        if asked > within:
            raise UnlikeRecordsError(
                f"{name} record: its drive reaches {asked:.4g} V, that of the hysteresis record"
                f" only {within:.4g} V; record both in volts, the {name} at a smaller drive"
            )


def refuse_other_gain(ratio: float) -> None:
    """Refuse a gain (1) of the frequency over the hysteresis record that no one scanner has.

    Raises UnlikeRecordsError.
    """
    if not LIKE_GAINS[0] <= ratio <= LIKE_GAINS[1]:
        raise UnlikeRecordsError(
            f"frequency record: it shows {ratio:.4g} times the gain of the hysteresis record;"
            " they are of different axes, scanners, units or signs: record both anew"
        )


REST = 1e-3
"""Share of its range by which a drive may end away from where it began."""
FAR, UNLIKE = 0.9, 0.05
"""Share of the farthest motion beyond which the lengths of two records may differ by UNLIKE."""


def cross_findings(
    model: AxisModel,
    creep: AxisRecord,
    frequency: AxisRecord,
    hysteresis: AxisRecord,
    validation: AxisRecord | None,
) -> Iterator[Finding]:
    """Yield where a record contradicts the others."""
    records = {"creep": creep, "frequency": frequency, "hysteresis": hysteresis}
    if validation is not None:
        records["validation"] = validation
    for name, record in records.items():
        yield from _unfinished(name, record)
    yield from _creep(model, creep)
    yield from _frequency(model, frequency.freed_of(model.creep))


def validation_findings(record: AxisRecord, result: Validation) -> Iterator[Finding]:
    """Yield where a validation record is not as the model predicts."""
    measured = record.displacement
    yield from _saturated("validation", record, shortfalls(measured - result.residual, measured))
    share = float(np.linalg.norm(result.model_discrepancy.rms) / np.std(measured))
    if share > PREDICTED:
        yield ValidationMismatch("the validation record", share)


def _unfinished(name: str, record: AxisRecord) -> Iterator[Finding]:
    first, second, last = record.drive[[0, 1, -1]]
    near = REST * np.ptp(record.drive)
    from_rest = first == second or abs(first) <= near
    if from_rest and abs(last - first) > near:
        yield UnfinishedRecord(name, float(first), float(last))


def _creep(model: AxisModel, creep: AxisRecord) -> Iterator[Finding]:
    chain = forward(model, creep.sample_period)
    expected = chain.apply(chain.at_rest(), creep.drive)[1]
    far = np.abs(expected) > FAR * np.abs(expected).max()
    ratio = float(creep.displacement[far].mean() / expected[far].mean())
    if abs(ratio - 1.0) > UNLIKE:
        yield CreepGainMismatch(ratio, float(np.abs(creep.drive[far]).max()))


def _frequency(model: AxisModel, waves: AxisRecord) -> Iterator[Finding]:
    if is_sweep(waves.drive) or not is_periodic(waves.drive[:, np.newaxis]):
        return
    spectra = strongest_waves(model.hysteresis.operator(), waves)
    if len(spectra.inputs) == 1:
        yield SingleWave()
    period = repetition(waves.drive[:, np.newaxis])
    lines = np.rint(spectra.omega * period * waves.sample_period / (2.0 * np.pi)).astype(int)
    yield from _saturated("frequency", waves, shortfalls(*_inputs(spectra, lines, period)))


def _inputs(spectra: RecordSpectra, lines: Array, period: int) -> tuple[Array, Array]:
    """Return the input F of the waves, V, and the input estimated from their output, both (n,)."""
    response = response_matrix(spectra).response[:, 0, 0]
    given = np.zeros((2, len(spectra.inputs), period // 2 + 1), dtype=np.complex128)
    given[0][:, lines] = spectra.inputs[:, :, 0]
    given[1][:, lines] = spectra.outputs[:, :, 0] / response
    expected, found = np.fft.irfft(given, period).reshape(2, -1)
    return expected, found


def _saturated(
    name: str, record: AxisRecord, short: Sequence[tuple[str, float]]
) -> Iterator[Finding]:
    for end, share in short:
        yield SaturatedRecord(name, end, share, float(np.ptp(record.drive)))
