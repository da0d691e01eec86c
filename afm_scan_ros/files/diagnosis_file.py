"""``diagnosis.json``: what a residual was traced to, for machines."""

import json
import math
from pathlib import Path
from typing import Any

from afm_scan_ros.core.diagnosis.diagnosis import Diagnosis
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport
from afm_scan_ros.core.diagnosis.result import Alternative, IdentifiedEffect, Value
from afm_scan_ros.core.diagnosis.suggestion import Suggestion
from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.files.residual_section import residual_section

Document = dict[str, Any]

EXPERIMENTED = "experiments"
"""Folder in which an experiment that is proposed is recorded."""


def account_document(found: ResidualReport) -> Document:
    """Return a diagnosis as the file has it, with its suggestions and its residual described."""
    return {
        **diagnosis_document(found.diagnosis),
        "suggestions": [_suggestion(each) for each in found.suggestions],
        "residual": residual_section(found),
    }


def diagnosis_document(found: Diagnosis) -> Document:
    """Return a diagnosis in the file's terms; lengths in m, parameters in their units.

    The tracking errors are null: they are known once the scan is repeated.
    """
    return {
        "verdict": found.verdict,
        "residual_rms_is_of": "all records together, on the stretches that no fit saw",
        "noise_floor_m": found.noise_floor,
        "residual_rms_before_m": found.rms_before,
        "residual_rms_after_m": found.rms_after,
        "effects": [_effect(effect) for effect in found.effects],
        "alternatives": [_alternative(each) for each in found.alternatives],
        "next_experiment": proposal(found.experiment),
        "cautions": list(found.cautions),
        "tracking_rms_before_m": None,
        "tracking_rms_after_m": None,
    }


def proposal(experiment: str | None) -> str | None:
    """Say what to record next, as it is typed, and why; None where nothing is left to settle."""
    if experiment is None:
        return None
    return (
        f"Record with 'afm-scan calibrate --experiment {experiment} --out {EXPERIMENTED}'"
        f" ({EXPERIMENTS[experiment].purpose}), for a simulated scanner with the --plant of these"
        f" records, then diagnose {EXPERIMENTED}/{experiment} together with these."
    )


def save_diagnosis(path: Path, document: Document) -> None:
    """Write a document; numbers that are not finite have no place in it."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", "utf-8")


def _suggestion(found: Suggestion) -> Document:
    terms = zip(found.symbols, found.coefficients, found.units, strict=True)
    return {
        "axis": found.axis,
        "equation": found.equation,
        "terms": [
            {"term": symbol, "coefficient_nm": value, "per_unit": unit}
            for symbol, value, unit in terms
        ],
        "explained_fraction": found.explained,
    }


def _effect(effect: IdentifiedEffect) -> Document:
    kind: Document = {"kind": {"value": effect.kind, "interval_95": None, "unit": ""}}
    return {
        "name": effect.name,
        "kind": effect.kind,
        "kind_words": entry(effect.name).kind_words(effect.kind),
        "axis": effect.axis,
        "parameters": {
            **(kind if effect.kind else {}),
            **{v.parameter.name: _parameter(v) for v in effect.values},
        },
        "explained_fraction": effect.explained_fraction,
        "evidence": list(effect.evidence),
    }


def _alternative(other: Alternative) -> Document:
    return {
        "name": other.name,
        "kind": other.kind,
        "kind_words": other.kind_words,
        "axis": other.axis,
        "score": other.score,
        "why_not": other.why_not,
    }


def _parameter(value: Value) -> Document:
    known = math.isfinite(value.halfwidth)
    return {
        "value": value.value,
        "interval_95": list(value.interval) if known else [None, None],
        "unit": value.parameter.unit,
    }
