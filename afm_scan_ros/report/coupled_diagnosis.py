"""The diagnosis of coupled axes, for terminal, report and ``diagnosis.json``."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, CERTAIN, SUFFICIENT, UNEXPLAINED
from afm_scan_ros.core.diagnosis.coupled.diagnosis import CoupledDiagnosis
from afm_scan_ros.core.diagnosis.result import IdentifiedEffect, joined
from afm_scan_ros.core.diagnosis.search import OUTSIDE
from afm_scan_ros.core.effects.registry import COUPLED_EFFECTS
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.files.coupled_file import save_coupled
from afm_scan_ros.report import html
from afm_scan_ros.report.diagnosis_json import save_diagnosis
from afm_scan_ros.report.diagnosis_text import (
    LIMITS,
    TRIED,
    VERDICTS,
    probabilities,
    probability_text,
    why_not_text,
)
from afm_scan_ros.report.provenance import Provenance, heading_lines, provenance_section, warnings
from afm_scan_ros.report.quantity import nanometres, significant
from afm_scan_ros.report.table import Part, Rows

EFFECTS = ("effect", "probability", "share of the residual's\nmean square, %")
RESIDUAL = ("axis", "residual, model,\nrms in nm", "with the effects", "detection\nlimit")
HELD_OUT = "Residuals are rms of the last record of each amplitude, which no fit saw."
METHOD = (
    "Each set of effects is fitted with the structure to all records but the last of each"
    " amplitude. Its simulation of these is compared with them. The likelihood of what it leaves is"
    " Student's t distribution in each band, of noise and the error that the model states."
)


def result(found: CoupledDiagnosis) -> Iterator[Part]:
    """Yield verdict, effects, probabilities and residuals."""
    yield VERDICTS[found.verdict]
    if found.effects:
        named = [(e.name, probability_text(e.probability), _share(e)) for e in found.effects]
        yield Rows(EFFECTS, named)
    yield from probabilities(found)
    figures = found.rms_before, found.rms_after, found.noise_floor
    left = [(axis, *(nanometres(of[axis]) for of in figures)) for axis in found.base.axes]
    yield Rows(RESIDUAL, left)
    yield HELD_OUT


def next_record(found: CoupledDiagnosis) -> str | None:
    """Say what to record to resolve an ambiguous case; None where nothing is."""
    if found.verdict not in (AMBIGUOUS, UNEXPLAINED):
        return None
    sets = found.posterior.credible(CERTAIN) if found.verdict == AMBIGUOUS else ()
    names = {name for names in sets if names != OUTSIDE for name in names}
    needs = {e.needs for e in COUPLED_EFFECTS if e.feedback and e.name in names}
    wanted = "; ".join(sorted(needs)) or "steady periods at further amplitudes"
    return f"Record more realisations, and diagnose them together with these: {wanted}."


def next_steps(found: CoupledDiagnosis) -> Iterator[str]:
    """Yield what to do next."""
    if said := next_record(found):
        yield f"next: {said}"
    elif found.verdict == SUFFICIENT:
        yield "next: Nothing above the detection limit: use this model."
    else:
        yield "next: Use model.extended.yaml in place of the model."
    for effect in (e for e in COUPLED_EFFECTS if e.name in found.selected):
        advice = effect.advice[0].upper() + effect.advice[1:]
        yield f"{effect.name}. {LIMITS[effect.remedy]}. {advice}."


def write(folder: Path, found: CoupledDiagnosis, heading: str, of: Provenance) -> None:
    """Write diagnosis.json, the extended model and the report."""
    folder.mkdir(parents=True, exist_ok=True)
    save_diagnosis(folder / "diagnosis.json", {**document(found), "provenance": plain(of)})
    save_coupled(folder / "model.extended.yaml", found.model, f"{heading}\n{heading_lines(of)}")
    parts = (
        html.heading("Result"),
        *html.texts((*result(found), *next_steps(found))),
        html.heading("Alternatives"),
        html.table(TRIED, _alternatives(found)),
        html.heading("Method"),
        html.paragraph(METHOD),
    )
    page = html.page("Diagnosis of coupled axes", *warnings(of), *parts, *provenance_section(of))
    (folder / "report.html").write_text(page, "utf-8")


def document(found: CoupledDiagnosis) -> dict[str, Any]:
    """Return the diagnosis in the file's terms; lengths in m, parameters in their units."""
    logs = found.posterior.logs
    fits = {names: trial.bands.log_likelihood for names, trial in found.posterior.trials.items()}
    return {
        "verdict": found.verdict,
        "residual_rms_is_of": "the last record of each amplitude, which no fit saw",
        "noise_floor_m": found.noise_floor,
        "residual_rms_before_m": found.rms_before,
        "residual_rms_after_m": found.rms_after,
        "effects": [_effect(effect) for effect in found.effects],
        "alternatives": [
            {
                "name": other.name,
                "axis": other.axis,
                "score": other.score if math.isfinite(other.score) else None,
                "probability": other.probability,
                "why_not": why_not_text(other),
            }
            for other in found.alternatives
        ],
        "probabilities": found.probabilities,
        "next_experiment": next_record(found),
        "likelihood": {
            joined(names): {"log_likelihood": fits.get(names), "log_probability": log}
            for names, log in logs.items()
        },
        "tracking_rms_before_m": None,
        "tracking_rms_after_m": None,
    }


def _effect(effect: IdentifiedEffect) -> dict[str, Any]:
    of = effect.evidence
    before, after = (significant(1e9 * rms) for rms in (of.rms_without, of.rms_with))
    return {
        "name": effect.name,
        "axis": effect.axis,
        "parameters": {
            v.parameter.name: {"value": v.value, "interval_95": None, "unit": v.parameter.unit}
            for v in effect.values
        },
        "probability": effect.probability,
        "explained_fraction": effect.explained_fraction,
        "evidence": [
            f"Of records that no fit saw {before} nm rms is left without it, {after} nm with it.",
            f"The log likelihood with it exceeds that without it by {significant(of.nats)} nats.",
            f"The largest remaining band is {significant(of.largest_ratio, 2)} times its limit.",
        ],
    }


def _share(effect: IdentifiedEffect) -> str:
    return significant(100.0 * effect.explained_fraction)


def _alternatives(found: CoupledDiagnosis) -> list[tuple[str, ...]]:
    return [
        (other.name, other.axis, probability_text(other.probability), why_not_text(other))
        for other in found.alternatives
    ]
