"""An identification as JSON, ``MODEL.fit.json``, and what it found wrong in sentences."""

from functools import singledispatch
from math import ceil, isfinite
from typing import Any

import numpy as np
from attrs import asdict

from afm_scan_ros.core.identification import findings as found
from afm_scan_ros.core.identification.creep.fit import CreepFit, half_width
from afm_scan_ros.core.identification.fit_report import AxisReport, OperatorChoice
from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.identification.together import FittedAxis
from afm_scan_ros.core.identification.vibration.line_response import LOCAL
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit
from afm_scan_ros.core.identification.vibration.structure import OrderChoice
from afm_scan_ros.core.model import EXACT, DuhemSlopes, HysteresisModel, ModelDiscrepancy, Status

SENTENCES: dict[type[found.Finding], str] = {
    found.NegativeCreepGain: "Creep element {element} ({time_constant:.4g} s) has a negative gain,"
    " which creep cannot have. The record contains another drift. Let the scanner rest, then"
    " record again.",
    found.SlowStep: "A step of the creep record took {duration:.2g} s. Hysteresis may hide"
    " {hidden:.1%} of creep element 1 in it. Step within one sample.",
    found.AmplitudeDependentResponse: "The small-signal response depends on the amplitude: waves"
    " differ by {nonlinearity:.1%}, and noise explains {noise:.1%}. This is hysteresis. Drive with"
    " a smaller amplitude.",
    found.DistortedSweep: "There is hysteresis in the sweep. Its third harmonic is {harmonic:.1%}"
    " of the fundamental, so the gain is some {gain:.0%} above that at small amplitude. Sweep with"
    " less amplitude, or record periodic multisines.",
    found.LowCoherence: "The coherence is below {limit} from {frequency:.0f} Hz on. Drive with a"
    " larger amplitude there, or record more periods.",
    found.NarrowBand: "The band is too narrow: {band[0]:.0f} to {band[1]:.0f} Hz for a resonance at"
    " {resonance:.0f} Hz. Drive from below {needed[0]:.0f} Hz to above {needed[1]:.0f} Hz.",
    found.GainMismatch: "The gain of the frequency record is {ratio:.3f} times that of the"
    " hysteresis record. The two records contradict each other. Record both again.",
    found.InexactInverse: "Exact inverse on held-out loops: sigma {sigma:.2%}, max {maximum:.2%} of"
    " the drive's range. The model of the hysteresis does not represent this scanner fully.",
    found.InexactDirectInverse: "Direct inverse on held-out loops: sigma {sigma:.4f} V, max"
    " {maximum:.3f} V. The paper's values are {paper_sigma} V and {paper_maximum} V of 8 V.",
    found.OpenLoops: "The effective input F differs by {difference:.3g} V among the returns to"
    " saturation. The scanner drifts in a way that the creep model does not describe.",
    found.UnfinishedRecord: "The {record} record ends at {last:.3g} V, not at {first:.3g} V where"
    " it began. It was cut short. Record it to its end.",
    found.CreepGainMismatch: "The creep record moves {ratio:.3f} times as far as the other records"
    " predict. It saturates below {drive:.3g} V, or it is of another scanner, axis, unit or sample"
    " rate. Record it again.",
    found.SingleWave: "The frequency record holds one wave, so distortion by hysteresis shows only"
    f" as scatter from line to line. From {LOCAL} lines on the intervals include it. Record"
    " several draws of the phases to narrow them.",
    found.SaturatedRecord: "The {record} record saturates: at the {end} of its motion it falls"
    " short by {share:.1%} of its range. Record it with less than {drive:.3g} V peak to peak.",
    found.ValidationMismatch: "The model predicts {record}, which was not fitted, with an rms error"
    " of {share:.1%} of that record's motion. Check that all records are of one axis and one setup,"
    " at the sample rates given. If they are, add records of the sizes and rates of {record}, and"
    " of each effect that is stated as unknown.",
    found.NotValidated: "All records were fitted, so the model's error is not known."
    " Give a validation record: other sizes and rates than those that were fitted.",
    found.NotConverged: "The fit has not converged: the likelihood may still grow by"
    " {remaining:.3g} nat, so the intervals do not hold. Give further records, of other sizes and"
    " rates.",
    found.ReadAfterUpdate: "The displacement in {record} follows a step of its drive within that"
    " sample, so each was taken as read after the drive's update. The model predicts what is read"
    " just before it: compare its predictions with the next sample.",
    found.UncertainScan: "The records tell a scan over the whole drive to {share:.1%} of its range"
    " only (one standard deviation). Add triangles or loops over the whole drive, of several"
    " amplitudes.",
}
"""Findings that are worded with their figures as they are."""

CAUSES = {
    found.MisfitCause.MODES: "The scanner has more modes in this band than the model.",
    found.MisfitCause.NOISE: "Noise is {share:.2%} of the response. Drive with a larger amplitude,"
    " or record more periods.",
    found.MisfitCause.NONLINEARITY: "Nonlinearity is {share:.2%} of the response. Drive with a"
    " smaller amplitude.",
}


@singledispatch
def finding_text(finding: found.Finding) -> str:
    """Say what was found and what to do about it."""
    return SENTENCES[type(finding)].format(**asdict(finding))  # type: ignore[arg-type] # all are attrs


@finding_text.register
def _(one: found.UndeterminedCreepElement) -> str:
    gain = _known("gain", one.gain, one.gain_interval)
    tau = _known("time constant", one.time_constant, one.time_constant_interval, " s")
    return f"Creep element {one.element} is not determined: {gain}, {tau}. {_longer(one)}"


@finding_text.register
def _(one: found.CreepBeyondNoise) -> str:
    return (
        f"The held-out error of the creep model, sigma {1e9 * one.sigma:.3g} nm, exceeds the"
        f" record's noise of {1e9 * one.noise:.3g} nm. The record is too short, or the scanner"
        " drifts. Let the scanner rest at constant temperature, then hold the drive longer."
    )


@finding_text.register
def _(one: found.ShortHold) -> str:
    return (
        f"The drive was held for {one.hold:.0f} s at most. Creep elements slower than"
        f" {one.slowest:.0f} s cannot be separated from one another or from drift. Hold the drive"
        f" for {one.needed / 60.0:.0f} min."
    )


@finding_text.register
def _(one: found.CoarseLines) -> str:
    half = one.width / 2.0
    return (
        f"The frequency lines are too coarse: every {one.spacing:.1f} Hz across a resonance"
        f" {one.width:.1f} Hz wide. Drive at most every {half:.1f} Hz, with periods of"
        f" {1.0 / half:.2g} s or more."
    )


@finding_text.register
def _(one: found.UnmodelledDelay) -> str:
    verb, fix = ("lags", ", or identify with --delay") if one.delay > 0.0 else ("leads", "")
    low, high = sorted(abs(end) for end in one.interval)
    return (
        f"The frequency record {verb} the model by {1e6 * abs(one.delay):.1f} µs (95 % interval"
        f" {1e6 * low:.1f} to {1e6 * high:.1f} µs). Sample drive and displacement on one clock"
        f"{fix}."
    )


@finding_text.register
def _(one: found.ResponseMisfit) -> str:
    low, high = one.band
    return (
        f"The vibration model differs from the response by {one.misfit:.2%} rms from {low:.0f} to"
        f" {high:.0f} Hz. {CAUSES[one.cause].format(share=one.share)}"
    )


@finding_text.register
def _(one: found.UnknownStart) -> str:
    return (
        f"The hysteresis' state at the start of {one.record} is unknown, so its first"
        f" {one.seconds:.3g} s were not fitted. Depolarise the scanner before a record, and state"
        " that."
    )


@finding_text.register
def _(one: found.SensorLowPass) -> str:
    return (
        f"The displacement is read through a low-pass of order {one.order} at {one.corner:.4g} Hz,"
        " as of a sensor's electronics. The model predicts what is read, and its inverse leaves the"
        " low-pass alone: in motion the scanner is ahead of what the sensor shows."
    )


@finding_text.register
def _(one: found.Hum) -> str:
    lines = ", ".join(f"{1e9 * size:.2g} nm at {hertz:.6g} Hz" for hertz, size in one.lines)
    return (
        f"The {one.record} record holds a periodic disturbance: {lines}. It is no part of the"
        " model. Find its source, or keep it off the sensor and the amplifier."
    )


def operator_text(choice: OperatorChoice) -> str:
    """Word which operator was chosen, by what, and the residual of either."""
    preisach, duhem = 1e9 * choice.preisach.sigma, 1e9 * choice.duhem.sigma
    return (
        f"{choice.chosen.capitalize()} operator, by {choice.record}: Preisach's leaves"
        f" {preisach:.1f} nm rms, Duhem's {duhem:.1f} nm"
    )


def inverse_text(which: str, model: HysteresisModel) -> str:
    """Name the ``exact`` or ``direct`` inverse, its map, and whether the model chose it."""
    mapped = ""
    if which == EXACT and isinstance(model.forward, DuhemSlopes):
        mapped = " of a Duhem operator"
    elif which == EXACT and model.output is not None:
        mapped = " behind an output map"
    return f"{which} inverse{mapped}{', chosen' if which == model.inverse else ''}"


def _known(name: str, value: float, interval: found.Interval, unit: str = "") -> str:
    low, high = interval
    share = half_width(value, interval)
    if isfinite(share):
        return f"{name} {value:.4g}{unit} ±{share:.0%} ({low:.4g} to {high:.4g}{unit})"
    if low > 0.0:
        return f"{name} above {low:.4g}{unit}"
    return f"{name} below {high:.4g}{unit}" if isfinite(high) else f"{name} unknown"


def _longer(one: found.UndeterminedCreepElement) -> str:
    if one.time_constant <= one.hold:
        return "Take a larger step or sample faster."
    closed = isfinite(one.time_constant_interval[1])
    needed = one.time_constant if closed else 10.0 * one.hold
    return f"The drive was held for {one.hold:.0f} s. Hold it for {ceil(needed / 60.0)} min."


RECORDS = {
    "creep": "creep; the order is chosen on its last hold, then the whole record is fitted",
    "vibration": "frequency; response to F = H(u), after the converter's hold",
    "hysteresis": "hysteresis; reversal curves are fitted, the loops after them are held out",
}
"""What is fitted on what."""


CREEP_ORDER = (
    "The order is the smallest with positive gains that is not worse than the best such order. An"
    " order is worse if its held-out error is larger by both 2 % and two standard errors."
)
VIBRATION_ORDER = (
    "The order has the least value of Schwarz's criterion: the squared error over its expected"
    " size, and a cost for each number fitted. Orders with a mode outside the band, or in fewer"
    " than three lines, are excluded."
)


def fit_summary(identification: Identification) -> dict[str, Any]:
    """Return the fit report by axis: what was fitted on what, figures of merit, warnings.

    Misfits are those of the paper's Eqs. 2, 3, 18 and 19, intervals of 95 %; an end that a record
    leaves open is null.
    """
    full = {name: _axis(axis) for name, axis in identification.axes.items()}
    return full | {name: together_summary(axis) for name, axis in identification.together.items()}


def together_summary(found: FittedAxis) -> dict[str, Any]:
    """Return the figures of an axis whose records were fitted together."""
    known = found.validation and _model_discrepancy(found.validation.model_discrepancy)
    return {
        "records": {name: {"left_rms_m": left} for name, left in found.left.items()},
        "operator": found.operator,
        "discrepancy_over_motion": found.discrepancy,
        "scan_deviation_over_range": found.deviation,
        "effects": asdict(found.model.effects, value_serializer=_plain),
        "model_discrepancy": known,
        "warnings": [finding_text(finding) for finding in found.warnings],
    }


def _plain(_owner: Any, _field: Any, value: Any) -> Any:  # noqa: ANN401 - attrs' own
    return value.value if isinstance(value, Status) else value


def _axis(found: AxisIdentification) -> dict[str, Any]:
    report = found.report
    return {
        "creep": {"record": RECORDS["creep"], **_creep(report.creep)},
        "vibration": {"record": RECORDS["vibration"], **_vibration(report)},
        "hysteresis": {"record": RECORDS["hysteresis"], **_hysteresis(found)},
        "rounds": report.rounds,
        "last_change": report.change,
        "model_discrepancy": found.validation
        and _model_discrepancy(found.validation.model_discrepancy),
        "warnings": [finding_text(finding) for finding in report.warnings],
    }


def _creep(fit: CreepFit) -> dict[str, Any]:
    return {
        "order": fit.order,
        "criterion": CREEP_ORDER,
        "held_out_sigma_m_by_order": {str(t.order): t.held_out.sigma for t in fit.orders},
        "gains": fit.model.gains,
        "time_constants_s": fit.model.time_constants,
        "intervals": {name: _closed(interval) for name, interval in fit.intervals.items()},
        "noise_m": fit.noise,
        "fitted": _misfit(fit.fitted, "m"),
        "held_out": _misfit(fit.held_out, "m"),
    }


def _vibration(report: AxisReport) -> dict[str, Any]:
    fit, checks = report.vibration, report.checks
    return {
        "order": str(fit.order),
        **_figures(fit),
        "resonance_interval_hz": fit.resonance_interval,
        "damping_interval": fit.damping_interval,
        "gain_interval": _closed(fit.gain_interval),
        "intervals_span": {name: _figures(other) for name, other in checks.alternatives.items()},
        "at_zero_amplitude": checks.at_zero and _figures(checks.at_zero),
        "orders_tried": checks.orders and _orders(checks.orders),
        "delay": _delay(report),
        "band_hz": fit.band,
        "relative_misfit_rms": fit.misfit,
        "noise_share": fit.noise_share,
        "nonlinearity_share": fit.nonlinearity_share,
    }


def _figures(fit: RationalFit) -> dict[str, float]:
    return {
        "resonance_hz": fit.resonance,
        "damping": fit.damping,
        "gain_over_reference": fit.gain_ratio,
    }


def _orders(choice: OrderChoice) -> dict[str, Any]:
    """Each order's error on the waves held out; the one chosen is the model's."""
    return {
        "criterion": VIBRATION_ORDER,
        "relative_error_rms": {str(trial.order): trial.misfit for trial in choice.trials},
        "modes_determined": {str(trial.order): trial.determined for trial in choice.trials},
    }


def _delay(report: AxisReport) -> dict[str, Any]:
    """Delay of the frequency record; ``determined`` where the model that shows it fits."""
    fit, delay = report.vibration, report.checks.delay
    return {
        "found_s": delay.delay,
        "interval_s": delay.interval,
        "relative_misfit_rms": delay.misfit,
        "determined": report.checks.identifies_delay(fit),
        "of_the_model_s": fit.model.delay,
    }


def _hysteresis(found: AxisIdentification) -> dict[str, Any]:
    report, model = found.report, found.model.hysteresis
    return {
        "drive_range_v": report.drive_range,
        "effective_range_v": report.effective_range,
        "closure_v": report.closure,
        "exact_inverse_held_out": report.exact and _misfit(report.exact, "v"),
        "direct_inverse_held_out": report.direct and _misfit(report.direct, "v"),
        "inverse": model.inverse,
        "operator": report.operator and _operator(report.operator),
        "output_map": model.output is not None,
    }


def _operator(choice: OperatorChoice) -> dict[str, Any]:
    return {
        "chosen": choice.chosen,
        "record": choice.record,
        "preisach_held_out": _misfit(choice.preisach, "m"),
        "duhem_held_out": _misfit(choice.duhem, "m"),
    }


def _model_discrepancy(known: ModelDiscrepancy) -> dict[str, Any]:
    return {
        "record": known.record,
        "bands_hz": known.bands,
        "rms_m": known.rms,
        "noise_rms_m": known.noise,
        "displacement_rms_m": known.displacement,
    }


def _closed(interval: tuple[float, float]) -> list[float | None]:
    return [float(end) if np.isfinite(end) else None for end in interval]


def _misfit(misfit: Misfit, unit: str) -> dict[str, float]:
    return {f"sigma_{unit}": misfit.sigma, f"max_{unit}": misfit.maximum, "samples": misfit.samples}
