"""Records of one axis, of any kinds → its model, by one fit of them all."""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.hysteresis.preisach import DirectInverse
from afm_scan_ros.core.effects.sensor import led
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.directions import scans
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.fit.signals import known_from, steps_read_after
from afm_scan_ros.core.fit.stretches import averaged
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.findings import (
    Finding,
    Hum,
    LateReading,
    NotConverged,
    NotValidated,
    ReadAfterUpdate,
    SensorLowPass,
    UncertainScan,
    UnknownStart,
    ValidationMismatch,
)
from afm_scan_ros.core.identification.local_response import FrequencyResponse, local_response
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.identification.spread_of_fit import HeldOut, spread_of
from afm_scan_ros.core.identification.validation import (
    PREDICTED,
    Validation,
    of_fitted,
    validate_from,
)
from afm_scan_ros.core.intersample import HELD
from afm_scan_ros.core.model import AxisModel, EffectStatus, Status
from afm_scan_ros.core.prediction import apart, discrepancy
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import Array, ProgressCallback


@frozen(eq=False)
class FittedRecord:
    """A record that was fitted: what the model leaves (m) at ``seconds`` from its start, (n,) both.

    The model is the one that is saved, and begins at depolarised rest; ``by_fit`` is what the fit
    left (m), which has finer surfaces and may have estimated how the record began. ``drive`` (V)
    and the fit's ``effective`` input F (V) are those of all its samples, and ``response`` is that
    of its displacement (m) to F, of the lines that it shows.
    """

    name: str
    sample_period: float
    seconds: Array
    left: Array
    drive: Array
    effective: Array
    response: FrequencyResponse
    by_fit: Misfit

    @property
    def misfit(self) -> Misfit:
        """Standard deviation and maximum of what the model leaves, m (Eqs. 2, 3)."""
        return misfit(self.left)

    @property
    def fitted_otherwise(self) -> bool:
        """Whether the model leaves more or less than the fit by a share that is stated."""
        apart = abs(self.misfit.sigma - self.by_fit.sigma)
        return apart > DEFAULT_SETTINGS.stated_loss * self.by_fit.sigma


@frozen(eq=False)
class FittedAxis:
    """The model of an axis with figures of its fit.

    ``operator`` is that of the hysteresis; ``discrepancy`` is η, the model's error over the motion;
    ``deviation`` is the standard deviation of a predicted scan over its range (1). ``direct`` is
    the error (V) of the drive that the paper's direct inverse gives for F of all records (Eqs. 18,
    19). ``validations`` are of the records held out.
    """

    model: AxisModel
    operator: str
    discrepancy: float
    deviation: float
    records: tuple[FittedRecord, ...]
    direct: Misfit
    warnings: tuple[Finding, ...]
    validations: tuple[Validation, ...]


def identify_axis(
    records: Sequence[Record],
    axis: str,
    progress: ProgressCallback = lambda _: None,
    *,
    linear: bool = False,
) -> FittedAxis:
    """Identify an axis, ``linear`` or not, from all its records but those that are to validate.

    Raises InputError where the records show nothing or are not of one scanner, ScanError where the
    fit diverges.
    """
    held_out = [one for one in records if one.kind == "validation"]
    fitting = [one for one in records if one.kind != "validation"]
    if not fitting:
        raise InputError("validation records alone fit nothing: give more records")
    fit = fit_axis(fitting, axis, progress=progress, linear=linear)
    progress("what the records tell of each effect")
    told = Knowledge.of(fit)
    effects = told.effects()
    operator = "one state" if isinstance(fit.layout.operator, OneState) else "plays"
    if linear:
        effects = evolve(effects, hysteresis=EffectStatus(Status.ASSUMED))
        operator = "none"
    model = evolve(model_of(fit), effects=effects)
    progress("validating")
    left_out = [_held_out(model, one, axis) for one in held_out]
    validations = [one.validation for one in left_out]
    spread = spread_of(told, model, left_out)
    deviation = _of_scan(model, spread, fit)
    known = [one.model_discrepancy for one in validations]
    for one in fitting:
        error = validate_from(model, _in_step(model, one.axis(axis)), 0).model_discrepancy
        known.append(of_fitted(error, fit.discrepancy))
    return FittedAxis(
        model=evolve(model.also_known(known), spread=spread),
        operator=operator,
        discrepancy=fit.discrepancy,
        deviation=deviation,
        records=tuple(_fitted_records(fit, model)),
        direct=_direct_misfit(model, [one.drive for one in fit.records]),
        warnings=(
            *_read_after(model, records, axis),
            *_of_fit(fit),
            *_uncertain(deviation),
            *_of_validation(held_out, validations),
        ),
        validations=tuple(validations),
    )


def _fitted_records(fit: AxisFit, model: AxisModel) -> Iterator[FittedRecord]:
    simulated, residuals = fit.simulated(fit.theta), fit.residuals()
    for k, (one, simulation, by_fit) in enumerate(
        zip(fit.records, simulated, residuals, strict=True)
    ):
        drive, effective, left = one.drive, simulation.effective, _left_by(model, fit, k)
        response = local_response(drive, effective, one.displacement, one.period)
        every_sample = drive, effective, response
        yield FittedRecord(one.name, one.period, one.seconds, left, *every_sample, misfit(by_fit))


def _left_by(model: AxisModel, fit: AxisFit, k: int) -> Array:
    """What a model leaves (m) of a record of a fit, less what is free in the record."""
    one = fit.records[k]
    cascade = forward(model, one.period)
    moved = cascade.apply(cascade.at_rest(), one.given)[1]
    left = averaged(one.displacement - moved, one.block)[one.used]
    return fit.free_of(k, gathered=False).without(left)


def _direct_misfit(model: AxisModel, drives: Sequence[Array]) -> Misfit:
    """Error of the drives (V) that the direct inverse gives for what they make of F.

    The F of one state may lie beyond the direct surface, whose end then counts.
    """
    exact, surface = model.hysteresis.operator(), model.hysteresis.direct
    direct, errors = DirectInverse(surface), []
    for drive in drives:
        effective = exact.apply(exact.at_rest(), drive)[1]
        within = np.clip(effective, *surface.drive_range)
        errors.append(direct.invert(direct.inverse_at_rest(), within)[1] - drive)
    return misfit(np.concatenate(errors))


def error_of(model: AxisModel, record: Record, axis: str) -> Validation:
    """Return a model's residual of a record, from where its memory is known on.

    Raises InputError where the drive leaves the identified range.
    """
    return _held_out(model, record, axis).validation


def _held_out(model: AxisModel, record: Record, axis: str) -> HeldOut:
    given = _in_step(model, record.axis(axis))
    first = known_from(given.drive[:, 0], DEFAULT_SETTINGS, depolarised=record.depolarised)
    return HeldOut(given, first, validate_from(model, given, first))


def _of_scan(model: AxisModel, spread: Spread, fit: AxisFit) -> float:
    """Standard deviation of a predicted scan but for its mean, over its range (1).

    It is the last cycle of a fast scan over the whole drive, from depolarised rest.
    """
    drive, period = next(scans(fit))
    cycle, cascade = slice(-DEFAULT_SETTINGS.scan_samples, None), forward(model, period)
    moved = cascade.apply(cascade.at_rest(), drive)[1][cycle]
    known = np.var(apart(model, spread, drive, period)[:, cycle], axis=1).sum()
    return float(np.sqrt(known + discrepancy(spread, moved, period) ** 2) / np.ptp(moved))


def _in_step(model: AxisModel, record: Record) -> Record:
    """Return a record of one axis as it were read just before its drive's updates."""
    return evolve(record, drive=led(record.drive)) if _was_read_after(model, record) else record


def _was_read_after(model: AxisModel, record: Record) -> bool:
    if model.reads_after:
        return record.intersample == HELD
    return steps_read_after(record, DEFAULT_SETTINGS)


def _read_after(model: AxisModel, records: Sequence[Record], axis: str) -> Iterator[Finding]:
    """Yield the records that were read after their drive's updates."""
    for one in records:
        if _was_read_after(model, one.axis(axis)):
            yield ReadAfterUpdate(one.name, model.reads_after)


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
        if sensor.corner is not None:
            yield SensorLowPass(sensor.order, sensor.corner)
        if sensor.delay:
            yield LateReading(sensor.delay)
    if not fit.converged:
        yield NotConverged(fit.remaining)


def _uncertain(deviation: float) -> Iterator[Finding]:
    """Yield that the records do not tell what a scan is, where they do not."""
    if deviation > DEFAULT_SETTINGS.poor:
        yield UncertainScan(deviation)


def _of_validation(records: Sequence[Record], results: Sequence[Validation]) -> Iterator[Finding]:
    """Yield what is wrong with the held-out data, or that there are none."""
    if not records:
        yield NotValidated()
    for record, result in zip(records, results, strict=True):
        moved = float(np.std(record.displacement))
        share = float(np.linalg.norm(result.model_discrepancy.rms)) / moved
        if share > PREDICTED:
            yield ValidationMismatch(record.name, share)
