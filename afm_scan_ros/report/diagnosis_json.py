"""``diagnosis.json`` and ``closed_loop.json``: a diagnosis and a closed loop, for machines."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from afm_scan_ros.core.closed_loop import FIRST, Round
from afm_scan_ros.core.comparison import ScanComparison, rms_of
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.experiments import Proposal
from afm_scan_ros.core.diagnosis.residual_report import Description, ResidualReport, report_residual
from afm_scan_ros.core.diagnosis.result import Alternative, IdentifiedEffect, Value, joined
from afm_scan_ros.core.diagnosis.search import Selection
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.metrics import Tracking, plain
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.report import diagnosis_text
from afm_scan_ros.report.close_loop import reported
from afm_scan_ros.report.residual import initial_state_text

Document = dict[str, Any]


def account_document(found: ResidualReport) -> Document:
    """Return a diagnosis as the file has it, with its residual described."""
    return {
        **diagnosis_document(found.diagnosis),
        "residual": residual_section(found),
        "likelihood": {
            axis: _likelihood(diagnosed.selection)
            for axis, diagnosed in found.diagnosis.by_axis.items()
        },
        "model_deviations": {
            axis: list(diagnosed.deviations) for axis, diagnosed in found.diagnosis.by_axis.items()
        },
        "refitted": {
            axis: dict(diagnosed.selection.refitted)
            for axis, diagnosed in found.diagnosis.by_axis.items()
        },
    }


def diagnosis_document(found: ScannerDiagnosis) -> Document:
    """Return a diagnosis in the file's terms; lengths in m, parameters in their units.

    The tracking errors are null: they are known once the scan is repeated.
    """
    return {
        "verdict": found.verdict,
        "residual_rms_is_of": "all records together, on stretches that the values were not fitted"
        " to",
        "noise_floor_m": found.noise_floor,
        "residual_rms_before_m": found.rms_before,
        "residual_rms_after_m": found.rms_after,
        "effects": [_effect(effect) for effect in found.effects],
        "alternatives": [_alternative(each) for each in found.alternatives],
        "probabilities": found.probabilities,
        "next_experiment": diagnosis_text.next_experiment(found),
        "proposed_experiment": found.proposal and _proposal(found.proposal),
        "cautions": [diagnosis_text.caution_text(each) for each in found.cautions],
        "tracking_rms_before_m": None,
        "tracking_rms_after_m": None,
    }


def save_diagnosis(path: Path, document: Document) -> None:
    """Write a document; numbers that are not finite have no place in it."""
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


def _effect(effect: IdentifiedEffect) -> Document:
    kind: Document = {"kind": {"value": effect.kind, "interval_95": None, "unit": ""}}
    return {
        "name": effect.name,
        "kind": effect.kind,
        "kind_words": effect_type(effect.name).kind_label(effect.kind),
        "axis": effect.axis,
        "parameters": {
            **(kind if effect.kind else {}),
            **{v.parameter.name: _parameter(v) for v in effect.values},
        },
        "probability": effect.probability,
        "explained_fraction": effect.explained_fraction,
        "evidence": list(diagnosis_text.evidence_text(effect)),
    }


def _alternative(other: Alternative) -> Document:
    return {
        "name": other.name,
        "kind": other.kind,
        "kind_words": other.kind_label,
        "axis": other.axis,
        "score": other.score,
        "probability": None if math.isnan(other.probability) else other.probability,
        "why_not": diagnosis_text.why_not_text(other),
    }


def _proposal(of: Proposal) -> Document:
    expected = of.motion, of.bits, of.probability
    motion, bits, probability = (None if math.isnan(value) else value for value in expected)
    return {
        "name": of.experiment.name,
        "axis": of.axis,
        "amplitude_v": of.experiment.amplitude,
        "amplitude_m": motion,
        "duration_s": of.experiment.duration,
        "expected_bits": bits,
        "expected_probability": probability,
    }


def _parameter(value: Value) -> Document:
    known = math.isfinite(value.halfwidth)
    return {
        "value": value.value,
        "interval_95": list(value.interval) if known else [None, None],
        "unit": value.parameter.unit,
    }


DIGITS = 5


def residual_section(found: ResidualReport) -> Document:
    """Return, by axis, a list of the records with their residual before and after."""
    return {
        axis: [
            {
                "record": before.record,
                "initial_hysteresis_state": initial_state_text(before),
                "rms_is_of": "the whole record",
                "floor": _figures(evidence.limit, LIMIT),
                "cells": _cells(evidence),
                "before": _described(before),
                "after": _described(after),
            }
            for evidence, before, after in zip(
                diagnosed.evidence, found.before[axis], found.after[axis], strict=True
            )
        ]
        for axis, diagnosed in found.diagnosis.by_axis.items()
    }


def _cells(evidence: Evidence) -> Document:
    """Return the variance of the residual in each cell, and its degrees of freedom."""
    variance, repetition = evidence.variance, evidence.cells.repetition
    return {
        "periods": repetition and repetition.periods,
        "variance_m2": variance.total.tolist(),
        "freedom": variance.freedom.tolist(),
        "known_from": variance.known.tolist(),
    }


def _likelihood(found: Selection) -> Document:
    """Return the log likelihood of each set's best trial, and its log probability; in nats."""
    fits = {(): found.without, **found.posterior.best}
    return {
        joined(names): {**_fit(fits.get(names)), "log_probability": log}
        for names, log in found.posterior.logs.items()
    }


def _fit(found: FittedCandidates | None) -> Document:
    if found is None:
        return dict.fromkeys(("log_likelihood", "log_base", "cell_rms_m"))
    return {
        "log_likelihood": found.cells.log_likelihood,
        "log_base": found.cells.log_base,
        "cell_rms_m": np.sqrt(found.cells.power).tolist(),
    }


LIMIT = {"bands_hz": "edges", "rms_m": "rms", "noise_rms_m": "noise"}
DESCRIPTION = {"rms_m": "rms", "band_rms_m": "bands"}
CORRELATION = {
    "lags_s": "lags",
    "values": "values",
    "white_band_95": "white",
    "bootstrap_band_95": "bootstrap",
    "share_outside_white_band": "outside_white",
    "share_outside_bootstrap_band": "outside_bootstrap",
}
COHERENCE = {"bands": "values", "chance": "chance"}
DEPENDENCE = {
    "unit": "unit",
    "centres": "centres",
    "mean_m": "mean",
    "rms_m": "rms",
    "samples": "count",
    "explained_fraction": "share",
}
LOCKED = {"to_scan": "to_scan", "to_time": "to_time", "rest": "rest"}
SIDES = {"alike_rms_m": "equivalent", "unlike_rms_m": "unlike"}
"""Keys of the file, and the attributes that they are of."""


def _described(one: Description) -> Document:
    return {
        **_figures(one, DESCRIPTION),
        "autocorrelation": _figures(one.own, CORRELATION),
        "cross_correlation": _by_name(one.correlations, CORRELATION),
        "coherence": _by_name(one.coherences, COHERENCE),
        "dependence": _by_name(one.dependences, DEPENDENCE),
        "locked": one.repeats and _figures(one.repeats, LOCKED),
        "trace_against_retrace": one.sides and _figures(one.sides, SIDES),
        "lines": [{"frequency_hz": line, "rms_m": size} for line, size in one.lines],
    }


def _by_name(every: Mapping[str, object], keys: Mapping[str, str]) -> Document:
    return {name: _figures(each, keys) for name, each in every.items()}


def _figures(of: object, keys: Mapping[str, str]) -> Document:
    return {key: _plain(getattr(of, name)) for key, name in keys.items()}


def _plain(value: Any) -> Any:  # noqa: ANN401 - a number, text or an array of numbers
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype.kind == "i":
        return value.tolist()
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in value]


def diagnosis_of(rounds: Sequence[Round]) -> Document:
    """Return ``diagnosis.json``: of the last round whose model was kept, or else of the first.

    The tracking errors are the measured ones of the diagnosed scan, before the first round and
    after that one.
    """
    last = reported(rounds)
    document = account_document(report_residual(last.diagnosis))
    if last.comparisons:
        document["tracking_rms_before_m"] = _rms(rounds[0].comparisons[FIRST].measured_before)
        document["tracking_rms_after_m"] = _rms(last.comparisons[FIRST].measured_after)
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
        "residual_rms_is_of": "the whole scan made with the extended inverse, which is held out",
        "residual": {axis: plain(rms) for axis, rms in trial.residual.items()},
    }
    for moment in ("measured_before", "measured_after", "true_before", "true_after"):
        tracking = getattr(trial, moment)
        figures[moment] = plain(tracking) if tracking else None
    return figures


def _rms(tracking: Tracking) -> dict[str, float]:
    return {axis: rms_of(tracking, axis) for axis in AXES}
