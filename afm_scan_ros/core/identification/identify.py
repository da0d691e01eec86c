"""Records of a scanner → its model and a report of how well it fits.

Creep needs neither of the others: the drive rests while it is seen. Hysteresis and vibration are
then identified in turns. The residual of a record that was
not fitted is the model discrepancy.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from attrs import evolve, field, frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.identification.agreement import (
    UnlikeRecordsError,
    cross_findings,
    loops_after,
    refuse_other_gain,
    refuse_unlike,
    validation_findings,
)
from afm_scan_ros.core.identification.alternating import AxisRecord, Converged, Sizes, alternate
from afm_scan_ros.core.identification.creep.fit import CreepFit, fit_creep
from afm_scan_ros.core.identification.creep.record import MANY, rests_briefly
from afm_scan_ros.core.identification.findings import Finding, Hum, NotValidated
from afm_scan_ros.core.identification.fit_report import (
    AxisReport,
    OperatorChoice,
    VibrationChecks,
    check_vibration,
    choose_operator,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    FreshLoops,
    ReversalCurves,
    fresh_loops,
    reversal_curves,
)
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.identification.records.recording import checked, misfit
from afm_scan_ros.core.identification.statuses import (
    creep_status,
    hysteresis_status,
    spanning,
    vibration_status,
)
from afm_scan_ros.core.identification.together import FittedAxis, error_of, identify_together
from afm_scan_ros.core.identification.validation import Validation, error_on_waves, validate
from afm_scan_ros.core.identification.vibration.frequency_response import response_at_zero_amplitude
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit
from afm_scan_ros.core.model import AxisModel, BaseEffects, HysteresisModel, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Array, ProgressCallback

DEFAULT_SIZES = Sizes()
REQUIRED = ("creep", "frequency", "hysteresis")
"""Kinds of record of which one each identifies all base effects."""


@frozen(eq=False)
class AxisIdentification:
    """What was fitted to one axis, with the signals between, for report and figures.

    ``drive`` and ``effective``, both (n,) in V, are u and F of the hysteresis record;
    ``sample_period`` (s) is that of the frequency record. ``at_zero_amplitude`` is the response to
    the drive u as it vanishes, where the frequency record has waves of several amplitudes.
    """

    model: AxisModel
    report: AxisReport
    response: FrequencyResponse
    at_zero_amplitude: FrequencyResponse | None
    sample_period: float
    drive: Array
    effective: Array
    fresh: FreshLoops | None
    validation: Validation | None

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What a user should know before trusting the model."""
        return self.report.warnings


def _with_kind(record: Record) -> Record:
    """Return the record of an axis with the kind that its drive shows, where none is stated.

    Steps that are held too shortly to show creep show the ring-down; those of a staircase are
    motion, as that of a scan's slow axis.
    """
    drive = record.drive[:, 0]
    kind = record.kind or recognised(drive)
    if record.kind is None and kind == "creep" and rests_briefly(drive, record.sample_period):
        kind = "frequency" if len(np.unique(drive)) <= MANY else None
    return evolve(record, kind=kind)


@frozen(eq=False)
class Identification:
    """The identified scanner: ``axes`` of which there was a record of each kind.

    Those ``together`` were fitted to what other records there were, all at once.
    """

    axes: Mapping[str, AxisIdentification]
    together: Mapping[str, FittedAxis] = field(factory=dict)

    @property
    def model(self) -> ScannerModel:
        """The model of all axes."""
        found: dict[str, AxisIdentification | FittedAxis] = {**self.axes, **self.together}
        return ScannerModel(**{name: axis.model for name, axis in found.items()})


def identify_records(
    records: Sequence[Record],
    sizes: Sizes = DEFAULT_SIZES,
    progress: ProgressCallback = lambda _: None,
) -> Identification:
    """Identify each axis from whatever records of it there are, of any number and kinds.

    With one each of creep, frequency response and reversal curves an axis is identified as by
    ``identify_axis``, where that leaves hardly anything of any record; further records are then
    held out and give the model's error. Otherwise all are fitted together, and what they do not
    identify is unknown in the model. Raises InputError where records are not of one scanner or show
    nothing, ScanError where a fit does not converge.
    """
    full, together = {}, {}
    given = [checked(record) for record in records]
    for axis in AXES:
        of_axis = [_with_kind(record.axis(axis)) for record in given if axis in record.axes]
        if not of_axis:
            continue
        with _naming(axis), _naming_records(of_axis):
            found = _of_any(of_axis, axis, sizes, _named(progress, axis))
        if isinstance(found, FittedAxis):
            together[axis] = found
        else:
            full[axis] = found
    return Identification(full, together)


def _of_any(
    records: Sequence[Record], axis: str, sizes: Sizes, progress: ProgressCallback
) -> AxisIdentification | FittedAxis:
    """Identify an axis by its records of each kind in turns, or else by all of them together.

    Fits in turns are kept where they leave hardly anything of any record. A record that they
    explain so from depolarised rest did begin there. Of two models that is kept which leaves less
    of the record that neither was fitted to, or without one, less of the worst record.
    """
    first = {record.kind: record for record in reversed(records) if record.kind is not None}
    if sizes != DEFAULT_SIZES:
        if not set(REQUIRED) <= set(first):
            raise InputError(
                "levels, order and delay are of an identification from one record each of creep,"
                " frequency and hysteresis: leave them out, or give these records"
            )
        return _in_turns(first, records, axis, sizes, progress)
    if not set(REQUIRED) <= set(first):
        return identify_together(records, axis, progress)
    try:
        found = _in_turns(first, records, axis, sizes, progress)
        at_rest = [evolve(record, start="depolarised") for record in records]
        left = _shares_left(found.model, at_rest, axis)
    except (UnlikeRecordsError, ScanError) as error:
        progress(f"fits in turns: {error}")
        return identify_together(records, axis, progress)
    most = DEFAULT_SETTINGS.left_in_turns
    if max(left) < most:
        return found
    progress(f"fits in turns leave {max(left):.2%} of a record's motion")
    pairs = zip(records, at_rest, left, strict=True)
    begun = [resting if share < most else record for record, resting, share in pairs]
    together = identify_together(begun, axis, progress)
    judging = [record for record in begun if record.kind == "validation"] or begun
    lefts = [max(_shares_left(one.model, judging, axis)) for one in (found, together)]
    return found if lefts[0] < lefts[1] else together


def _in_turns(
    first: Mapping[str, Record],
    records: Sequence[Record],
    axis: str,
    sizes: Sizes,
    progress: ProgressCallback,
) -> AxisIdentification:
    """Identify an axis by the first record of each kind; the others give the model's error."""
    signals = {kind: AxisRecord.of(record, axis) for kind, record in first.items()}
    creep, frequency, hysteresis = (signals[kind] for kind in REQUIRED)
    held_out = signals.get("validation")
    found = identify_axis(creep, frequency, hysteresis, held_out, sizes=sizes, progress=progress)
    further = [record for record in records if record not in first.values()]
    errors = (error_of(found.model, record, axis).model_discrepancy for record in further)
    return evolve(found, model=found.model.also_known(errors))


def _shares_left(model: AxisModel, records: Sequence[Record], axis: str) -> list[float]:
    """Share of each record's motion that a model leaves, above the sensor's noise and hum.

    Raises InputError where a drive leaves the identified range.
    """
    quiet = (_without_hum(record, axis) for record in records)
    errors = (error_of(model, record, axis).model_discrepancy for record in quiet)
    sizes = ((np.linalg.norm(one.rms), np.linalg.norm(one.displacement)) for one in errors)
    return [float(left / moved) for left, moved in sizes]


def _without_hum(record: Record, axis: str) -> Record:
    quiet, _ = AxisRecord.of(record, axis).without_hum()
    return evolve(record, displacement=quiet.displacement[:, np.newaxis])


def _named(progress: ProgressCallback, axis: str) -> ProgressCallback:
    return lambda message: progress(f"{axis}: {message}")


@contextmanager
def _naming(axis: str) -> Iterator[None]:
    """Begin what is raised by the axis' name."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{axis}: {error}") from error
    except ScanError as error:
        raise ScanError(f"{axis}: {error}") from error


@contextmanager
def _naming_records(records: Sequence[Record]) -> Iterator[None]:
    """Begin what is raised of the record of a kind by that record's name."""
    try:
        yield
    except InputError as error:
        kind, _, message = str(error).partition(" record: ")
        name = next((record.name for record in records if record.kind == kind), None)
        if name is None:
            raise
        raise InputError(f"{name}, a {kind} record: {message}") from error


def identify_axis(
    creep: AxisRecord,
    frequency: AxisRecord,
    hysteresis: AxisRecord,
    validation: AxisRecord | None = None,
    *,
    sizes: Sizes = DEFAULT_SIZES,
    progress: ProgressCallback = lambda _: None,
) -> AxisIdentification:
    """Identify one axis from a record of each kind, which begin at depolarised rest at zero.

    ``progress`` is called with what is being fitted. The model discrepancy is its residual on
    ``validation``, or, without one, on the loops at the end of the hysteresis record. Raises
    InputError where a record cannot show what it is for, ScanError where hysteresis and vibration
    do not settle.
    """
    progress("looking for hum")
    given = {"creep": creep, "frequency": frequency, "hysteresis": hysteresis}
    quiet = {name: record.without_hum() for name, record in given.items()}
    (creep, _), (frequency, _), (hysteresis, _) = quiet.values()
    progress("fitting creep")
    slow = fit_creep(creep.drive, creep.displacement, creep.sample_period)
    curves = reversal_curves(hysteresis.drive)
    loops, waves = hysteresis.freed_of(slow.model), frequency.freed_of(slow.model)
    refuse_unlike(creep, frequency, hysteresis)
    progress("fitting hysteresis and vibration alternately")
    converged = alternate(loops, waves, curves, sizes)
    progress("choosing the operator of the hysteresis")
    converged, choice = choose_operator(converged, slow.model, hysteresis, validation)
    refuse_other_gain(converged.turn.vibration.gain_ratio)
    progress("fitting alternatives")
    at_zero = response_at_zero_amplitude(waves.drive, waves.displacement, waves.sample_period)
    checks = check_vibration(converged, at_zero)
    vibration = spanning(converged.turn.vibration, checks.alternatives.values())
    model = _model(slow, converged.hysteresis, vibration, creep, frequency, hysteresis)
    progress("validating")
    result = _validation(model, hysteresis, curves, validation)
    findings: list[Finding] = [Hum.of(name, lines) for name, (_, lines) in quiet.items() if lines]
    findings += cross_findings(model, creep, frequency, hysteresis, validation)
    findings += _validation_findings(validation, result)
    drive, effective = hysteresis.drive, converged.turn.effective
    looped = loops_after(hysteresis, curves)
    fresh = fresh_loops(converged.hysteresis, drive, effective, curves.end) if looped else None
    return AxisIdentification(
        model=_with_model_discrepancy(model, frequency, result),
        report=_report(slow, converged, vibration, checks, choice, fresh, findings),
        response=converged.turn.response,
        at_zero_amplitude=at_zero,
        sample_period=frequency.sample_period,
        drive=drive,
        effective=effective,
        fresh=fresh,
        validation=result,
    )


def _model(
    slow: CreepFit,
    fitted: HysteresisModel,
    vibration: RationalFit,
    creep: AxisRecord,
    frequency: AxisRecord,
    hysteresis: AxisRecord,
) -> AxisModel:
    """Return the model that was fitted, and how its records know each effect."""
    effects = BaseEffects(
        creep=creep_status(slow, creep),
        hysteresis=hysteresis_status(hysteresis),
        vibration=vibration_status(vibration, frequency),
    )
    return AxisModel(fitted, vibration.model, slow.model, effects=effects)


def _validation_findings(
    validation: AxisRecord | None, result: Validation | None
) -> Iterator[Finding]:
    """Yield what is wrong with the held-out data, or that there are none."""
    if result is None:
        yield NotValidated()
    elif validation is not None:
        yield from validation_findings(validation, result)


def _with_model_discrepancy(
    model: AxisModel, frequency: AxisRecord, result: Validation | None
) -> AxisModel:
    """Model with its error on the held-out data, and on the waves."""
    if result is None:
        return model
    elsewhere = error_on_waves(model, frequency, result.sensor_noise)
    return evolve(model, model_discrepancy=result.model_discrepancy, known_elsewhere=elsewhere)


def _validation(
    model: AxisModel, hysteresis: AxisRecord, curves: ReversalCurves, validation: AxisRecord | None
) -> Validation | None:
    """Validate on the record made for it, or else on the loops after the reversal curves."""
    if validation is not None:
        return validate(model, validation, "validation")
    if not loops_after(hysteresis, curves):
        return None
    return validate(model, hysteresis, "hysteresis, the loops after its curves", curves.end)


def _report(
    creep: CreepFit,
    converged: Converged,
    vibration: RationalFit,
    checks: VibrationChecks,
    choice: OperatorChoice | None,
    fresh: FreshLoops | None,
    findings: Sequence[Finding],
) -> AxisReport:
    return AxisReport(
        creep=creep,
        vibration=vibration,
        checks=checks,
        exact=None if fresh is None else misfit(fresh.exact),
        direct=None if fresh is None else misfit(fresh.direct),
        operator=choice,
        drive_range=float(np.ptp(converged.turns.hysteresis.drive)),
        effective_range=converged.everett.effective_range,
        closure=converged.everett.closure,
        rounds=converged.turn.rounds,
        change=converged.turn.change,
        records=tuple(findings),
    )
