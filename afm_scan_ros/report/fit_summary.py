"""An identification as JSON, ``MODEL.fit.json``, and what it found wrong in sentences."""

from typing import Any

from attrs import asdict

from afm_scan_ros.core.identification.findings import Finding
from afm_scan_ros.core.identification.fitted_axis import FittedAxis
from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.model import ModelDiscrepancy, Status
from afm_scan_ros.report.sentences import sentence


def finding_text(finding: Finding) -> str:
    """Say what was found and what to do about it."""
    return sentence(f"finding.{type(finding).__name__}", of=finding)


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
