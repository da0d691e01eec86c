"""Records of a scanner → its model and a report of how well it fits.

Creep needs neither of the others: the drive rests while it is seen. Hysteresis and vibration are
then identified in turns. What is left of a record that fitted nothing is the model discrepancy.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.alternating import AxisRecord, Converged, Sizes, alternate
from afm_scan_ros.core.identification.alternatives import spanning
from afm_scan_ros.core.identification.creep.fit import CreepFit, fit_creep
from afm_scan_ros.core.identification.cross_checks import cross_findings, validation_findings
from afm_scan_ros.core.identification.findings import Finding, Hum
from afm_scan_ros.core.identification.fit_report import AxisReport, FreshLoops, fresh_loops
from afm_scan_ros.core.identification.hysteresis.reversal_curves import reversal_curves
from afm_scan_ros.core.identification.records.matches import refuse_other_gain, refuse_unlike
from afm_scan_ros.core.identification.records.recording import CalibrationRecord, misfit
from afm_scan_ros.core.identification.validation import Validation, error_on_waves, validate
from afm_scan_ros.core.identification.vibration.checks import VibrationChecks, check_vibration
from afm_scan_ros.core.identification.vibration.frequency_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.zero_amplitude import response_at_zero_amplitude
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.types import AXES, Array, ProgressCallback

DEFAULT_SIZES = Sizes()


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
    fresh: FreshLoops
    validation: Validation


@frozen(eq=False)
class Identification:
    """The identified scanner, axis by axis: those that every record holds."""

    axes: Mapping[str, AxisIdentification]

    @property
    def model(self) -> ScannerModel:
        """The model of these axes."""
        return ScannerModel(**{name: found.model for name, found in self.axes.items()})


def identify(
    creep: CalibrationRecord,
    frequency: CalibrationRecord,
    hysteresis: CalibrationRecord,
    validation: CalibrationRecord | None = None,
    sizes: Sizes = DEFAULT_SIZES,
    progress: ProgressCallback = lambda _: None,
) -> Identification:
    """Identify the axes that all records hold, each from its depolarised rest at zero.

    ``progress`` is called with what is being fitted. The model discrepancy is its residual on
    ``validation``, or, without one, on the loops at the end of the hysteresis record. Raises
    InputError where a record cannot show what it is for, ScanError where hysteresis and vibration
    do not settle.
    """
    records = [r for r in (creep, frequency, hysteresis, validation) if r is not None]
    axes = [axis for axis in AXES if all(axis in record.axes for record in records)]
    if not axes:
        held = ", ".join(f"{record.name}: {' and '.join(record.axes)}" for record in records)
        raise InputError(f"no axis is in every record ({held}); give records of one axis")
    return Identification({axis: _identified(axis, records, sizes, progress) for axis in axes})


def _identified(
    axis: str, records: Sequence[CalibrationRecord], sizes: Sizes, progress: ProgressCallback
) -> AxisIdentification:
    """Identify an axis, whose name begins what is raised and what is said of progress."""
    of_axis = (AxisRecord.of(record, axis) for record in records)
    try:
        return identify_axis(*of_axis, sizes=sizes, progress=lambda s: progress(f"{axis}: {s}"))
    except (InputError, ScanError) as error:
        raise type(error)(f"{axis}: {error}") from error


def identify_axis(
    creep: AxisRecord,
    frequency: AxisRecord,
    hysteresis: AxisRecord,
    validation: AxisRecord | None = None,
    *,
    sizes: Sizes = DEFAULT_SIZES,
    progress: ProgressCallback = lambda _: None,
) -> AxisIdentification:
    """Identify one axis, of however many the scanner has, from its records as ``identify`` does.

    Raises InputError where a record cannot show what it is for, ScanError where hysteresis and
    vibration do not settle.
    """
    progress("looking for hum")
    given = {"creep": creep, "frequency": frequency, "hysteresis": hysteresis}
    quiet = {name: record.without_hum() for name, record in given.items()}
    (creep, _), (frequency, _), (hysteresis, _) = quiet.values()
    progress("fitting creep")
    slow = fit_creep(creep.drive, creep.displacement, creep.sample_period)
    curves = reversal_curves(hysteresis.drive)
    loops, waves = hysteresis.freed_of(slow.model), frequency.freed_of(slow.model)
    refuse_unlike(creep, frequency, hysteresis, curves)
    progress("fitting hysteresis and vibration alternately")
    converged = alternate(loops, waves, curves, sizes)
    refuse_other_gain(converged.vibration.gain_ratio)
    model = AxisModel(converged.everett.model, converged.vibration.model, slow.model)
    progress("validating")
    left = _validation(model, hysteresis, curves.end, validation)
    findings: list[Finding] = [
        Hum(name, tuple((line.frequency, line.amplitude) for line in lines))
        for name, (_, lines) in quiet.items()
        if lines
    ]
    findings += cross_findings(model, creep, frequency, hysteresis, validation)
    if validation is not None:
        findings += validation_findings(validation, left)
    drive, effective = hysteresis.drive, converged.effective
    fresh = fresh_loops(converged.everett, drive[curves.end :], effective[curves.end :])
    progress("fitting alternatives")
    at_zero = response_at_zero_amplitude(waves.drive, waves.displacement, waves.sample_period)
    checks = check_vibration(converged, drive, waves, curves, at_zero)
    return AxisIdentification(
        model=_with_model_discrepancy(model, frequency, left),
        report=_report(slow, converged, checks, fresh, drive, findings),
        response=converged.response,
        at_zero_amplitude=at_zero,
        sample_period=frequency.sample_period,
        drive=drive,
        effective=effective,
        fresh=fresh,
        validation=left,
    )


def _with_model_discrepancy(model: AxisModel, frequency: AxisRecord, left: Validation) -> AxisModel:
    """Model with its error on the data that fitted nothing, and on the waves."""
    elsewhere = error_on_waves(model, frequency, left.sensor_noise)
    return evolve(model, model_discrepancy=left.model_discrepancy, known_elsewhere=elsewhere)


def _validation(
    model: AxisModel, hysteresis: AxisRecord, first: int, validation: AxisRecord | None
) -> Validation:
    """Validate on the record made for it, or else on the hysteresis record from ``first`` on."""
    if validation is None:
        return validate(model, hysteresis, "hysteresis, the loops after its curves", first)
    return validate(model, validation, "validation")


def _report(
    creep: CreepFit,
    converged: Converged,
    checks: VibrationChecks,
    fresh: FreshLoops,
    drive: Array,
    findings: Sequence[Finding],
) -> AxisReport:
    return AxisReport(
        creep=creep,
        vibration=spanning(converged.vibration, checks.alternatives.values()),
        checks=checks,
        exact=misfit(fresh.exact),
        direct=misfit(fresh.direct),
        drive_range=float(np.ptp(drive)),
        effective_range=converged.everett.effective_range,
        closure=converged.everett.closure,
        rounds=converged.rounds,
        change=converged.change,
        records=tuple(findings),
    )
