"""The results of an identification as JSON: ``MODEL.fit.json``."""

from typing import Any

import numpy as np
from attrs import asdict

from afm_scan_ros.core.identification.creep.fit import CreepFit
from afm_scan_ros.core.identification.fit_report import AxisReport, OperatorChoice
from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.identification.joint.axis import JointAxis
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.identification.vibration.order_selection import OrderChoice
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit
from afm_scan_ros.core.model import ModelDiscrepancy, Status
from afm_scan_ros.report.identification_text import finding_text

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
    return full | {name: joint_summary(axis) for name, axis in identification.joint.items()}


def joint_summary(found: JointAxis) -> dict[str, Any]:
    """Return the figures of an axis whose records were fitted together."""
    known = found.validation and _model_discrepancy(found.validation.model_discrepancy)
    return {
        "records": {each.name: each.kind or "motion" for each in found.records},
        "effects": asdict(found.model.effects, value_serializer=_plain),
        "fitted_rms_m": found.joint and found.joint.fitted,
        "held_out_rms_m": found.joint and found.joint.held_out,
        "smoothing": found.joint and found.joint.smoothing,
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
