"""Records of a scanner → the model of each axis, by one fit of all that there are of it."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.hysteresis.preisach import DirectInverse
from afm_scan_ros.core.effects.sensor import led
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of, scans
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.fit.signals import known_from, steps_read_after
from afm_scan_ros.core.fit.stretches import averaged
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.findings import Finding, ReadAfterUpdate, findings_of
from afm_scan_ros.core.identification.local_response import FrequencyResponse, local_response
from afm_scan_ros.core.identification.records.recording import Misfit, checked, misfit
from afm_scan_ros.core.identification.validation import (
    Validation,
    of_fitted,
    spread_of,
    validate_from,
)
from afm_scan_ros.core.intersample import HELD
from afm_scan_ros.core.model import AxisModel, EffectStatus, ScannerModel, Status
from afm_scan_ros.core.prediction import apart, discrepancy
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import AXES, Array, ProgressCallback, Step


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
    ``deviation`` is the standard deviation of a predicted scan over its range (1), of the worst of
    some sizes. ``direct`` is the error (V) of the drive that the paper's direct inverse gives for F
    of all records (Eqs. 18, 19). ``validations`` are of the records held out.
    """

    model: AxisModel
    operator: str
    discrepancy: float
    deviation: float
    records: tuple[FittedRecord, ...]
    direct: Misfit
    warnings: tuple[Finding, ...]
    validations: tuple[Validation, ...]


@frozen(eq=False)
class Identification:
    """The identified scanner, by axis."""

    axes: Mapping[str, FittedAxis]

    @property
    def model(self) -> ScannerModel:
        """The model of all axes."""
        return ScannerModel(**{name: axis.model for name, axis in self.axes.items()})


def identify_records(
    records: Sequence[Record],
    progress: ProgressCallback = lambda _: None,
    *,
    linear: bool = False,
) -> Identification:
    """Identify each axis from whatever records of it there are, of any number and kinds.

    A ``linear`` scanner has no hysteresis. Those of the kind "validation" are held out and give the
    model's error. What the others do not identify is unknown in the model. Raises InputError where
    records are not of one scanner or show nothing, ScanError where a fit diverges.
    """
    axes: dict[str, FittedAxis] = {}
    given = [checked(record) for record in records]
    present = [axis for axis in AXES if any(axis in record.axes for record in given)]
    for axis in present:
        of_axis = [record.axis(axis) for record in given if axis in record.axes]
        counted = _counted(progress, axis, len(axes), len(present))
        try:
            axes[axis] = identify_axis(of_axis, axis, counted, linear=linear)
        except InputError as error:
            raise InputError(f"{axis}: {error}") from error
        except ScanError as error:
            raise ScanError(f"{axis}: {error}") from error
    return Identification(axes)


def _counted(progress: ProgressCallback, axis: str, done: int, total: int) -> ProgressCallback:
    """Name the axis in each message, and count the axes that are over."""
    return lambda message: progress(Step(f"{axis}: {message}", done, total))


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
    validations = [seen for _, seen in left_out]
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
            *(
                ReadAfterUpdate(one.name, model.reads_after)
                for one in records
                if _was_read_after(model, one.axis(axis))
            ),
            *findings_of(fit, deviation, [*zip(held_out, validations, strict=True)]),
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


def _held_out(model: AxisModel, record: Record, axis: str) -> tuple[Record, Validation]:
    """Validate a model by a record, from where its memory is known on."""
    given = _in_step(model, record.axis(axis))
    first = known_from(given.drive[:, 0], DEFAULT_SETTINGS, depolarised=record.depolarised)
    return given, validate_from(model, given, first)


def _of_scan(model: AxisModel, spread: Spread, fit: AxisFit) -> float:
    """Greatest standard deviation of predicted scans but for their mean, over their ranges (1).

    It is of the last cycle of fast scans over the whole drive and parts of it, from depolarised
    rest.
    """
    cycle, shares = slice(-DEFAULT_SETTINGS.scan_samples, None), []
    for drive, period in islice(scans(fit), DEFAULT_SETTINGS.spread_sizes):
        cascade = forward(model, period)
        moved = cascade.apply(cascade.at_rest(), drive)[1][cycle]
        known = np.var(apart(model, spread, drive, period)[:, cycle], axis=1).sum()
        shares.append(np.sqrt(known + discrepancy(spread, moved, period) ** 2) / np.ptp(moved))
    return float(max(shares))


def _in_step(model: AxisModel, record: Record) -> Record:
    """Return a record of one axis as it were read just before its drive's updates."""
    return evolve(record, drive=led(record.drive)) if _was_read_after(model, record) else record


def _was_read_after(model: AxisModel, record: Record) -> bool:
    if model.reads_after:
        return record.intersample == HELD
    return steps_read_after(record, DEFAULT_SETTINGS)
