"""An identification as JSON, ``MODEL.fit.json``, and what it found wrong in sentences."""

from typing import Any

from attrs import asdict

from afm_scan_ros.core.identification import findings as found
from afm_scan_ros.core.identification.identify import FittedAxis, Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.model import ModelDiscrepancy, Status

SENTENCES: dict[type[found.Finding], str] = {
    found.ValidationMismatch: "The model predicts {record}, which was not fitted, with an rms error"
    " of {share:.1%} of that record's motion. Check that all records are of one axis and one setup,"
    " at the sample rates given. If they are, add records of the sizes and rates of {record}, and"
    " of each effect that is stated as unknown.",
    found.NotValidated: "All records were fitted, so the model's error is not known."
    " Give a validation record: other sizes and rates than those that were fitted.",
    found.NotConverged: "The fit has not converged: the likelihood may still grow by"
    " {remaining:.3g} nat, so the intervals do not hold. Give further records, of other sizes and"
    " rates.",
    found.UncertainScan: "The records tell a scan over the whole drive to {share:.1%} of its range"
    " only (one standard deviation). Add triangles or loops over the whole drive, of several"
    " amplitudes.",
    found.UnknownStart: "The hysteresis' state at the start of {record} is unknown, so its first"
    " {seconds:.3g} s were not fitted. Depolarise the scanner before a record, and state that.",
    found.SensorLowPass: "The displacement is read through a low-pass of order {order} at"
    " {corner:.4g} Hz, as of a sensor's electronics. The model predicts what is read, and its"
    " inverse leaves the low-pass alone: in motion the scanner is ahead of what the sensor shows.",
    found.LateReading: "The displacement is {delay} late, as of a converter's or a control box's"
    " buffer. The model predicts what is read, and its inverse leaves the delay alone, as if it"
    " were the sensor's: where the drive is late, so is the motion, by as much.",
    found.Hum: "{record} holds a periodic disturbance: {lines}. It is no part of the model. Find"
    " its source, or keep it off the sensor and the amplifier.",
    found.ReadAfterUpdate: "The displacement in {record} was read after each update of the drive,"
    " {predicted}",
}
READ_SO = "and the model predicts what is read so."
READ_BEFORE = (
    "which its steps show. The model predicts what is read just before, as in other records:"
    " compare its predictions with the next sample."
)


def finding_text(finding: found.Finding) -> str:
    """Say what was found and what to do about it."""
    values = asdict(finding)  # type: ignore[arg-type] # all are attrs
    match finding:
        case found.LateReading():
            values["delay"] = f"{1e3 * finding.delay:.4g} ms"
        case found.Hum():
            lines = (f"{1e9 * size:.2g} nm at {hertz:.6g} Hz" for hertz, size in finding.lines)
            values["lines"] = ", ".join(lines)
        case found.ReadAfterUpdate():
            values["predicted"] = READ_SO if finding.predicted else READ_BEFORE
    return SENTENCES[type(finding)].format(**values)


def fit_summary(identification: Identification) -> dict[str, Any]:
    """Return the fit report by axis: what was fitted, figures of merit, warnings.

    Misfits are those of the paper's Eqs. 2 and 3 (creep and vibration with hysteresis, m), and of
    its Eqs. 18 and 19 (direct inverse, V). Intervals are of 95 %.
    """
    return {name: _axis(axis) for name, axis in identification.axes.items()}


def _axis(found: FittedAxis) -> dict[str, Any]:
    model = found.model
    return {
        "records": {one.name: _misfit(one.misfit, "m") for one in found.records},
        "held_out": {one.record: _misfit(one.misfit, "m") for one in found.validations},
        "operator": found.operator,
        "output_map": model.hysteresis.output is not None,
        "direct_inverse": _misfit(found.direct, "v"),
        "creep": {"gains": model.creep.gains, "time_constants_s": model.creep.time_constants},
        "sensor": model.sensor and asdict(model.sensor),
        "discrepancy_over_motion": found.discrepancy,
        "scan_deviation_over_range": found.deviation,
        "effects": asdict(model.effects, value_serializer=_plain),
        "model_discrepancy": [_model_discrepancy(o.model_discrepancy) for o in found.validations],
        "warnings": [finding_text(finding) for finding in found.warnings],
    }


def _plain(_owner: Any, _field: Any, value: Any) -> Any:  # noqa: ANN401 - attrs' own
    return value.value if isinstance(value, Status) else value


def _model_discrepancy(known: ModelDiscrepancy) -> dict[str, Any]:
    return {
        "record": known.record,
        "bands_hz": known.bands,
        "rms_m": known.rms,
        "noise_rms_m": known.noise,
        "displacement_rms_m": known.displacement,
    }


def _misfit(misfit: Misfit, unit: str) -> dict[str, float]:
    return {f"sigma_{unit}": misfit.sigma, f"max_{unit}": misfit.maximum, "samples": misfit.samples}
