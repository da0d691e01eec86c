"""``closed_loop.json`` and the ``diagnosis.json`` of a closed loop, for machines."""

from collections.abc import Sequence
from typing import Any

from afm_scan_ros.core.closed_loop.comparison import ScanComparison, rms_of
from afm_scan_ros.core.closed_loop.loop import Round
from afm_scan_ros.core.closed_loop.test_scans import FIRST
from afm_scan_ros.core.diagnosis.residual_report import report_residual
from afm_scan_ros.core.metrics import Tracking, plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.diagnosis_file import Document, account_document, diagnosis_document


def diagnosis_of(rounds: Sequence[Round]) -> Document:
    """Return ``diagnosis.json``: of the last round whose model was kept, or else of the first.

    The tracking errors are those of the scan that taught, measured, before the first round and
    after that one.
    """
    told = next((done for done in reversed(rounds) if done.kept), rounds[0])
    document = account_document(report_residual(told.diagnosis))
    if told.comparisons:
        document["tracking_rms_before_m"] = _rms(rounds[0].comparisons[FIRST].measured_before)
        document["tracking_rms_after_m"] = _rms(told.comparisons[FIRST].measured_after)
    return document


def closed_loop_document(rounds: Sequence[Round], failure: str = "") -> Document:
    """Return what each round found, and the figures of each scan before and after.

    ``failure`` is what ended the round after these, if any.
    """
    return {"rounds": [_round(done) for done in rounds], "failure": failure or None}


def _round(done: Round) -> Document:
    return {
        "diagnosis": diagnosis_document(done.diagnosis),
        "experiments": list(done.experiments),
        "refusal": done.refusal or None,
        "kept": done.kept,
        "improved": done.improved,
        "trials": {name: _trial(done, name, trial) for name, trial in done.comparisons.items()},
    }


def _trial(done: Round, name: str, trial: ScanComparison) -> Document:
    spec = done.before[name].spec
    figures: dict[str, Any] = {
        "scan": {
            "pattern": spec.pattern,
            "line_rate_hz": spec.line_rate,
            "range_x_m": spec.range_x,
            "range_y_m": spec.range_y,
        },
        "after_over_before": trial.change,
        "residual_rms_is_of": "the whole scan made with the extended inverse, which no fit saw",
        "residual": {axis: plain(left) for axis, left in trial.residual.items()},
    }
    for moment in ("measured_before", "measured_after", "true_before", "true_after"):
        figures[moment] = plain(getattr(trial, moment))
    return figures


def _rms(tracking: Tracking) -> dict[str, float]:
    return {axis: rms_of(tracking, axis) for axis in AXES}
