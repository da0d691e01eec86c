"""Records of one axis, of any kinds → its model, by one fit of them all."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.fit.signals import in_step, known_from, reads_after
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.findings import (
    Finding,
    Hum,
    NotConverged,
    NotValidated,
    ReadAfterUpdate,
    SensorLowPass,
    UncertainScan,
    UnknownStart,
    ValidationMismatch,
)
from afm_scan_ros.core.identification.validation import (
    PREDICTED,
    Validation,
    of_fitted,
    validate_from,
)
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import ProgressCallback


@frozen(eq=False)
class FittedAxis:
    """The model of an axis with figures of its fit.

    ``operator`` is that of the hysteresis; ``discrepancy`` is η, the model's error over the motion;
    ``deviation`` is the standard deviation of a predicted scan over its range (1). ``left`` is the
    rms (m) that the model leaves of each record, by name. ``validation`` is of the record held out,
    where there is one.
    """

    model: AxisModel
    operator: str
    discrepancy: float
    deviation: float
    left: Mapping[str, float]
    warnings: tuple[Finding, ...]
    validation: Validation | None


def identify_together(
    records: Sequence[Record], axis: str, progress: ProgressCallback
) -> FittedAxis:
    """Identify an axis from all its records but one that is to validate.

    Raises InputError where the records show nothing or are not of one scanner, ScanError where the
    fit diverges.
    """
    held_out = next((one for one in records if one.kind == "validation"), None)
    fitting = [one for one in records if one is not held_out]
    if not fitting:
        raise InputError("a validation record alone fits nothing: give more records")
    fit = fit_axis(fitting, axis, progress=progress)
    progress("what the records tell of each effect")
    told = Knowledge.of(fit)
    model, deviation = evolve(model_of(fit), effects=told.effects()), told.of_scan()
    progress("validating")
    validation = None if held_out is None else error_of(model, held_out, axis)
    known = [] if validation is None else [validation.model_discrepancy]
    for one in fitting:
        error = validate_from(model, _in_step(one, axis), one.name, 0).model_discrepancy
        known.append(of_fitted(error, fit.discrepancy))
    left = fit.residuals()
    return FittedAxis(
        model=model.also_known(known),
        operator="one state" if isinstance(fit.layout.operator, OneState) else "plays",
        discrepancy=fit.discrepancy,
        deviation=deviation,
        left={r.name: float(np.std(each)) for r, each in zip(fit.records, left, strict=True)},
        warnings=(
            *_read_after(records, axis),
            *_of_fit(fit),
            *_of_scan(deviation),
            *_of_validation(held_out, validation),
        ),
        validation=validation,
    )


def error_of(model: AxisModel, record: Record, axis: str) -> Validation:
    """Return a model's residual of a record, from where its memory is known on.

    Raises InputError where the drive leaves the identified range.
    """
    signals = _in_step(record, axis)
    first = known_from(signals.drive, DEFAULT_SETTINGS, depolarised=record.depolarised)
    return validate_from(model, signals, record.name, first)


def _in_step(record: Record, axis: str) -> AxisRecord:
    """Return an axis of a record as it were read just before its drive's updates."""
    drive, moved = record.signals(axis)
    return AxisRecord(in_step(drive, moved, DEFAULT_SETTINGS), moved, record.sample_period)


def _read_after(records: Sequence[Record], axis: str) -> Iterator[Finding]:
    """Yield the records that were read after their drive's updates."""
    for one in records:
        if reads_after(*one.signals(axis), DEFAULT_SETTINGS):
            yield ReadAfterUpdate(one.name)


def _of_fit(fit: AxisFit) -> Iterator[Finding]:
    """Yield what a user should know of the records and of the fit before trusting the model.

    A tone smaller than the error of the model may be a part of that error, and is not told.
    """
    for record, tones in zip(fit.records, fit.tone_amplitudes(), strict=True):
        error = fit.discrepancy * record.motion
        if large := tuple((tone, size) for tone, size in tones if size > error):
            yield Hum(record.name, large)
    for record in fit.records:
        if record.first:
            yield UnknownStart(record.name, record.first * record.period)
    if sensor := fit.layout.sensor_of(fit.theta):
        yield SensorLowPass(sensor.order, sensor.corner)
    if not fit.converged:
        yield NotConverged(fit.remaining)


def _of_scan(deviation: float) -> Iterator[Finding]:
    """Yield that the records do not tell what a scan is, where they do not."""
    if deviation > DEFAULT_SETTINGS.poor:
        yield UncertainScan(deviation)


def _of_validation(record: Record | None, result: Validation | None) -> Iterator[Finding]:
    """Yield what is wrong with the held-out data, or that there are none."""
    if record is None or result is None:
        yield NotValidated()
        return
    moved = float(np.std(record.displacement))
    share = float(np.linalg.norm(result.model_discrepancy.rms)) / moved
    if share > PREDICTED:
        yield ValidationMismatch(record.name, share)
