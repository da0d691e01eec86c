"""Parameters of the nodes that invert and monitor a scan, and what is made of their values."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from afm_scan_ros.core.diagnosis.monitor import ALARM_RATIO, LINES, ResidualWatch
from afm_scan_ros.core.diagnosis.scan_monitor import ScanMonitor
from afm_scan_ros.core.effects.optimal_inverse import RelativeWeight, SmoothWeight, Weight
from afm_scan_ros.core.model import INVERSES, InverseSettings, ScannerModel
from afm_scan_ros.core.online import TIME_CONSTANT
from afm_scan_ros.core.online.adaptation import Adaptation
from afm_scan_ros.core.online.adapted_scan import adapted_scan
from afm_scan_ros.core.online.line_feedback import fed_back
from afm_scan_ros.core.scan_inversion import LATENCY, InversionSettings, MakeCorrection
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.nodes.parameters import DRIVE_LIMITS, NodeParameter, drive_limits, inverses_of

ADAPTATION = (
    NodeParameter(
        "adapt",
        default=False,
        description="Whether changes of gain, resonance and slow creep are tracked",
    ),
    NodeParameter(
        "adapt_time_constant_s", TIME_CONSTANT, "With adapt: memory of the estimator", low=0.0
    ),
)

_DEFAULT, _WEIGHT = InverseSettings(), RelativeWeight()
INVERSION = (
    NodeParameter("inverses", list(INVERSES), "Effects to invert: creep, ...; or none"),
    NodeParameter(
        "hysteresis_inverse",
        _DEFAULT.hysteresis_inverse,
        "Inverse of hysteresis: exact, the paper's direct inverse, or the model's choice",
        choices=("as_identified", "exact", "direct"),
    ),
    NodeParameter(
        "weight_corner_hz",
        0.0,
        f"Frequency above which the inverse limits the drive; 0 for {_WEIGHT.corner:g}"
        " times the first resonance",
        low=0.0,
    ),
    NodeParameter("weight_order", _WEIGHT.order, "Steepness of that transition", low=1, high=10),
    NodeParameter(
        "preview_ms",
        0.0,
        "Preview of the inverse; 0 for as long as its response needs",
        low=0.0,
        high=1000.0,
    ),
    *DRIVE_LIMITS,
    NodeParameter("learned_file", "", "Learned correction of this scan; empty for none"),
    NodeParameter(
        "preflight_samples",
        5_000_000,
        "Largest scan, in samples, that is inverted before it begins",
        low=0,
    ),
    NodeParameter(
        "line_feedback",
        default=False,
        description="Whether offset, tilt and gain are corrected from the last lines",
    ),
    NodeParameter(
        "feedback_latency_ms",
        LATENCY * 1e3,
        "With line_feedback or adapt: longest time from a sample's drive to its reading",
        low=0.0,
        high=10_000.0,
    ),
    *ADAPTATION,
)
MONITORING = (
    NodeParameter(
        "alarm",
        ALARM_RATIO,
        "Residual over model discrepancy that makes a line suspect",
        low=1.0,
    ),
    NodeParameter("alarm_lines", LINES, "Suspect lines in a row that raise the alarm", low=1),
    *ADAPTATION,
)


def inversion_settings(settings: Mapping[str, Any]) -> InversionSettings:
    """Return how a scan is inverted by the parameters ``INVERSION``; refuses limits of zero."""
    given = settings
    corrections: list[MakeCorrection] = []
    if given["line_feedback"]:
        corrections.append(fed_back)
    if given["adapt"]:
        corrections.append(partial(adapted_scan, given["adapt_time_constant_s"]))
    return InversionSettings(
        inverses_of(given["inverses"], INVERSES),
        drive_limits(given),
        InverseSettings(
            hysteresis_inverse=given["hysteresis_inverse"],
            weight=_weight(given["weight_corner_hz"], given["weight_order"]),
            preview=given["preview_ms"] * 1e-3 or None,
        ),
        corrections=tuple(corrections),
        latency=given["feedback_latency_ms"] * 1e-3,
    )


def scan_monitor(model: ScannerModel, spec: ScanSpec, settings: Mapping[str, Any]) -> ScanMonitor:
    """Return what monitors a scan by the parameters ``MONITORING``; raises as it does."""
    trackers = []
    if settings["adapt"]:
        trackers.append(Adaptation(model, spec, settings["adapt_time_constant_s"]).news)
    watch = ResidualWatch(settings["alarm"], settings["alarm_lines"])
    return ScanMonitor(model, spec, watch, trackers)


def _weight(corner: float, order: int) -> Weight | RelativeWeight:
    return SmoothWeight(corner, order) if corner else RelativeWeight(order=order)
