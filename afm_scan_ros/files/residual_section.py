"""What the model leaves of each record, as ``diagnosis.json`` has it."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from afm_scan_ros.core.diagnosis.describe import Description
from afm_scan_ros.core.diagnosis.description.correlation import Correlation
from afm_scan_ros.core.diagnosis.description.scan import Dependence, Locked, ToAndFro
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport

Document = dict[str, Any]
DIGITS = 5


def residual_section(found: ResidualReport) -> Document:
    """Return, by axis, a list of the records with their residual before and after."""
    return {
        axis: [
            {
                "record": before.record,
                "initial_memory": before.initial_state,
                "rms_is_of": "the whole record",
                "floor": _floor(evidence.floor),
                "before": _described(before),
                "after": _described(after),
            }
            for evidence, before, after in zip(
                trace.evidence, found.before[axis], found.after[axis], strict=True
            )
        ]
        for axis, trace in found.diagnosis.by_axis.items()
    }


def _floor(floor: DetectionLimit) -> Document:
    return {
        "bands_hz": list(floor.edges),
        "rms_m": _numbers(floor.rms),
        "noise_rms_m": _numbers(floor.noise),
    }


def _described(one: Description) -> Document:
    return {
        "rms_m": one.rms,
        "band_rms_m": _numbers(one.bands),
        "autocorrelation": _correlation(one.own),
        "cross_correlation": {name: _correlation(each) for name, each in one.correlations.items()},
        "coherence": {
            name: {"bands": _numbers(each.values), "chance": each.chance}
            for name, each in one.coherences.items()
        },
        "dependence": {name: _dependence(each) for name, each in one.dependences.items()},
        "locked": _locked(one.repeats),
        "trace_against_retrace": _sides(one.sides),
        "lines": [{"frequency_hz": line, "rms_m": size} for line, size in one.lines],
    }


def _correlation(of: Correlation) -> Document:
    return {
        "lags_s": _numbers(of.lags),
        "values": _numbers(of.values),
        "white_band_95": of.white,
        "bootstrap_band_95": of.bootstrap,
        "share_outside_white_band": of.outside_white,
        "share_outside_bootstrap_band": of.outside_bootstrap,
    }


def _dependence(of: Dependence) -> Document:
    return {
        "unit": of.unit,
        "centres": _numbers(of.centres),
        "mean_m": _numbers(of.mean),
        "rms_m": _numbers(of.rms),
        "samples": [int(count) for count in of.count],
        "explained_fraction": of.share,
    }


def _locked(of: Locked | None) -> Document | None:
    if of is None:
        return None
    return {"to_scan": of.to_scan, "to_time": of.to_time, "rest": of.rest}


def _sides(of: ToAndFro | None) -> Document | None:
    if of is None:
        return None
    return {"alike_rms_m": of.equivalent, "unlike_rms_m": of.unlike}


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]
