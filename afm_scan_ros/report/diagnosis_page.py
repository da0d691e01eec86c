"""The report on a residual, also of coupled axes: the page, and the folder that holds it."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    CERTAIN,
    SUFFICIENT,
    UNEXPLAINED,
    AxisDiagnosis,
)
from afm_scan_ros.core.diagnosis.coupled.diagnosis import CoupledDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.diagnosis.result import IdentifiedEffect, joined
from afm_scan_ros.core.diagnosis.search import OUTSIDE
from afm_scan_ros.core.effects.registry import COUPLED_EFFECTS
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.files.coupled_file import save_coupled
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.files.paths import replacing, write_text
from afm_scan_ros.report import html
from afm_scan_ros.report.diagnosis_json import account_document, save_diagnosis
from afm_scan_ros.report.diagnosis_text import (
    LIMITS,
    TRIED,
    VERDICTS,
    alternative_rows,
    evidence_text,
    form_text,
    next_steps,
    probabilities,
    probability_text,
    result,
    share_text,
    why_not_text,
)
from afm_scan_ros.report.provenance import Provenance, heading_lines
from afm_scan_ros.report.quantity import CONVENTION, nanometres, significant
from afm_scan_ros.report.residual import (
    chosen_text,
    initial_state_text,
    residual_figure,
    residual_text,
)
from afm_scan_ros.report.table import Part, Rows


def diagnosis_page(found: ResidualReport, drawn: Mapping[str, bytes], of: Provenance) -> str:
    """Return the report as a self-contained HTML page, with the pictures of the axes."""
    diagnosis = found.diagnosis
    states = [map(initial_state_text, found.before[axis]) for axis in found.before]
    return html.page(
        "diagnosis.html",
        provenance=of,
        result=result(diagnosis),
        next_steps=next_steps(diagnosis),
        effects=list(_effects(diagnosis)),
        alternatives=Rows(TRIED, alternative_rows(diagnosis)),
        residuals={axis: (_residual(found, axis), drawn[axis]) for axis in diagnosis.by_axis},
        records=zip(diagnosis.observations, zip(*states, strict=True), strict=True),
    )


def _figure(found: ResidualReport, diagnosed: AxisDiagnosis) -> Figure:
    record = most_excited_record(diagnosed)
    stages = [found.before[diagnosed.axis][record]]
    if diagnosed.final is not diagnosed.chain:
        stages.append(found.after[diagnosed.axis][record])
    return residual_figure(diagnosed.evidence[record].limit, *stages)


def _effects(found: ScannerDiagnosis) -> Iterator[str]:
    """Yield the equation of each effect and the evidence for it."""
    for effect in found.effects:
        yield form_text(effect)
        yield " ".join((share_text(effect), *evidence_text(effect)))
    if any(effect.periodic for effect in found.effects):
        yield CONVENTION


def _residual(found: ResidualReport, axis: str) -> Iterator[str]:
    """Yield what is known of the residual of an axis in the record that shows most of it."""
    diagnosed = found.diagnosis.by_axis[axis]
    record = most_excited_record(diagnosed)
    limit = diagnosed.evidence[record].limit
    before = found.before[axis][record]
    yield f"{chosen_text(diagnosed)}{before.record}: {' '.join(residual_text(before, limit))}"
    if diagnosed.final is not diagnosed.chain:
        after = residual_text(found.after[axis][record], limit)
        yield f"With the extended model: {' '.join(after)}"


def write_diagnosis(folder: Path, found: ResidualReport, heading: str, of: Provenance) -> None:
    """Write all files of a diagnosis; ``heading`` begins the comment at the head of the model's."""
    by_axis = found.diagnosis.by_axis
    drawn = {axis: html.png(_figure(found, diagnosed)) for axis, diagnosed in by_axis.items()}
    save_diagnosis(folder / "diagnosis.json", {**account_document(found), "provenance": plain(of)})
    head = f"{heading}\n{heading_lines(of)}"
    save_model(folder / "model.extended.yaml", found.diagnosis.model, head)
    write_text(folder / "report.html", diagnosis_page(found, drawn, of))
    for axis, content in drawn.items():
        with replacing(folder / f"residual_{axis}.png") as beside:
            beside.write_bytes(content)


COUPLED_ROWS = ("effect", "probability", "share of the residual's\nmean square, %")
RESIDUALS = ("axis", "residual, model,\nrms in nm", "with the effects", "detection\nlimit")
HELD_OUT = "Residuals are rms of the last record of each amplitude, which no fit saw."


def coupled_result(found: CoupledDiagnosis) -> Iterator[Part]:
    """Yield verdict, effects, probabilities and residuals."""
    yield VERDICTS[found.verdict]
    if found.effects:
        named = [(e.name, probability_text(e.probability), _share(e)) for e in found.effects]
        yield Rows(COUPLED_ROWS, named)
    yield from probabilities(found)
    figures = found.rms_before, found.rms_after, found.noise_floor
    left = [(axis, *(nanometres(of[axis]) for of in figures)) for axis in found.base.axes]
    yield Rows(RESIDUALS, left)
    yield HELD_OUT


def next_coupled_record(found: CoupledDiagnosis) -> str | None:
    """Say what to record to resolve an ambiguous case; None where nothing is."""
    if found.verdict not in (AMBIGUOUS, UNEXPLAINED):
        return None
    sets = found.posterior.credible(CERTAIN) if found.verdict == AMBIGUOUS else ()
    names = {name for names in sets if names != OUTSIDE for name in names}
    needs = {e.needs for e in COUPLED_EFFECTS if e.feedback and e.name in names}
    wanted = "; ".join(sorted(needs)) or "steady periods at further amplitudes"
    return f"Record more realisations, and diagnose them together with these: {wanted}."


def coupled_next_steps(found: CoupledDiagnosis) -> Iterator[str]:
    """Yield what to do next."""
    if said := next_coupled_record(found):
        yield f"next: {said}"
    elif found.verdict == SUFFICIENT:
        yield "next: Nothing above the detection limit: use this model."
    else:
        yield "next: Use model.extended.yaml in place of the model."
    for effect in (e for e in COUPLED_EFFECTS if e.name in found.selected):
        advice = effect.advice[0].upper() + effect.advice[1:]
        yield f"{effect.name}. {LIMITS[effect.remedy]}. {advice}."


def write_coupled(folder: Path, found: CoupledDiagnosis, heading: str, of: Provenance) -> None:
    """Write diagnosis.json, the extended model and the report."""
    save_diagnosis(folder / "diagnosis.json", {**coupled_document(found), "provenance": plain(of)})
    save_coupled(folder / "model.extended.yaml", found.model, f"{heading}\n{heading_lines(of)}")
    page = html.page(
        "coupled_diagnosis.html",
        provenance=of,
        result=coupled_result(found),
        next_steps=coupled_next_steps(found),
        alternatives=Rows(TRIED, _alternatives(found)),
    )
    write_text(folder / "report.html", page)


def coupled_document(found: CoupledDiagnosis) -> dict[str, Any]:
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
        "next_experiment": next_coupled_record(found),
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
