"""Parameters of the nodes that invert and monitor a scan, and what is made of their values."""

from collections.abc import Mapping
from typing import Any

from afm_scan_ros import features
from afm_scan_ros.core.diagnosis.monitor import ALARM_RATIO, LINES, ResidualWatch
from afm_scan_ros.core.diagnosis.scan_monitor import ScanMonitor
from afm_scan_ros.core.effects.optimal_inverse import RelativeWeight, SmoothWeight
from afm_scan_ros.core.model import INVERSES, InverseSettings, ScannerModel
from afm_scan_ros.core.scan_inversion import LATENCY, InversionSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.nodes.parameters import (
    DRIVE_LIMITS,
    NodeParameter,
    OnlineOption,
    drive_limits,
    inverses_of,
)

ONLINE: Mapping[str, OnlineOption] = features.options()
"""What features do while a scan runs, by its name."""

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
        "feedback_latency_ms",
        LATENCY * 1e3,
        f"With {' or '.join(ONLINE)}: longest time from a sample's drive to its reading",
        low=0.0,
        high=10_000.0,
    ),
    *(parameter for each in ONLINE.values() for parameter in each.parameters),
)
MONITORING = (
    NodeParameter(
        "alarm",
        ALARM_RATIO,
        "Residual over model discrepancy that makes a line suspect",
        low=1.0,
    ),
    NodeParameter("alarm_lines", LINES, "Suspect lines in a row that raise the alarm", low=1),
    *(parameter for each in ONLINE.values() if each.tracker for parameter in each.parameters),
)


def inversion_settings(settings: Mapping[str, Any]) -> InversionSettings:
    """Return how a scan is inverted by the parameters ``INVERSION``; refuses limits of zero."""
    given = settings
    corner, order = given["weight_corner_hz"], given["weight_order"]
    return InversionSettings(
        inverses_of(given["inverses"], INVERSES),
        drive_limits(given),
        InverseSettings(
            hysteresis_inverse=given["hysteresis_inverse"],
            weight=SmoothWeight(corner, order) if corner else RelativeWeight(order=order),
            preview=given["preview_ms"] * 1e-3 or None,
        ),
        corrections=tuple(e.correction(given) for name, e in ONLINE.items() if given[name]),
        latency=given["feedback_latency_ms"] * 1e-3,
    )


def scan_monitor(model: ScannerModel, spec: ScanSpec, settings: Mapping[str, Any]) -> ScanMonitor:
    """Return what monitors a scan by the parameters ``MONITORING``; raises as it does."""
    trackers = [
        each.tracker(model, spec, settings)
        for name, each in ONLINE.items()
        if each.tracker and settings[name]
    ]
    watch = ResidualWatch(settings["alarm"], settings["alarm_lines"])
    return ScanMonitor(model, spec, watch, trackers)
