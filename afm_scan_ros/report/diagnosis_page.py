"""The report on a residual, also of coupled axes: the page, and the folder that holds it."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    SUFFICIENT,
    UNEXPLAINED,
    AxisDiagnosis,
)
from afm_scan_ros.core.diagnosis.coupled.diagnosis import CoupledDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, most_excited_record
from afm_scan_ros.core.diagnosis.result import IdentifiedEffect, joined
from afm_scan_ros.core.diagnosis.search import OUTSIDE
from afm_scan_ros.core.diagnosis.settings import SEARCH
from afm_scan_ros.core.effects.registry import COUPLED_EFFECTS
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.files.coupled_file import save_coupled
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.report import diagnosis_text as text
from afm_scan_ros.report.diagnosis_json import account_document, save_diagnosis
from afm_scan_ros.report.page import Provenance, ReportPage, Section, heading_lines
from afm_scan_ros.report.picture import Picture
from afm_scan_ros.report.quantity import nanometres, probability, significant
from afm_scan_ros.report.residual import initial_state_text, residual_pictures, residual_text
from afm_scan_ros.report.sentences import sentence
from afm_scan_ros.report.table import Part, Rows

RECORDS = ("record", "samples", "sample period", "x at the start", "y at the start")


def diagnosis_report(found: ResidualReport, of: Provenance) -> ReportPage:
    """Return the report on a diagnosis, with the pictures of the axes."""
    diagnosis = found.diagnosis
    drawn = {axis: _pictures(found, each) for axis, each in diagnosis.by_axis.items()}
    first = max(drawn, key=lambda axis: diagnosis.rms_before[axis] / diagnosis.noise_floor[axis])
    residuals = [
        Section(
            f"The residual in {axis}",
            [*_residual(found, axis), *(pictures[1:] if axis == first else pictures)],
        )
        for axis, pictures in drawn.items()
    ]
    return ReportPage(
        title="Diagnosis of a scanner's residual",
        answer=[*text.brief(diagnosis), *_change(diagnosis)],
        picture=drawn[first][0],
        next_steps=list(text.next_steps(diagnosis)),
        evidence=[
            Section("Effects, probabilities and residuals", list(text.result(diagnosis))),
            *_effect_sections(diagnosis),
            *residuals,
            Section("Records", [Rows(RECORDS, list(_records(found)))]),
            Section("Method", [sentence("diagnosis.method")]),
        ],
        warnings=of.shortcomings,
        provenance=of,
    )


def _change(found: ScannerDiagnosis | CoupledDiagnosis) -> Iterator[str]:
    """Say in a sentence what the effects found explain of the residual."""
    each = []
    for axis, limit in found.noise_floor.items():
        figures = {"before": found.rms_before[axis], "after": found.rms_after[axis], "limit": limit}
        each.append(sentence("residual.change", axis=axis, **figures))
    yield f"Residual, rms: {'; '.join(each)}."


def _effect_sections(found: ScannerDiagnosis) -> Iterator[Section]:
    evidence = list(_effects(found))
    if evidence:
        yield Section("Evidence for the effects", [*evidence, sentence("diagnosis.shares")])
    alternatives = text.alternative_rows(found)
    if alternatives:
        yield Section("Alternatives", [Rows(text.TRIED, alternatives)])


def _records(found: ResidualReport) -> Iterator[tuple[str, ...]]:
    observations = found.diagnosis.observations
    states = zip(*(map(initial_state_text, each) for each in found.before.values()), strict=True)
    for record, state in zip(observations, states, strict=True):
        period = f"{1e6 * record.sample_period:g} µs"
        yield record.name, f"{len(record.drive):,}", period, *state


def _pictures(found: ResidualReport, diagnosed: AxisDiagnosis) -> tuple[Picture, Picture]:
    record, axis = most_excited_record(diagnosed), diagnosed.axis
    stages = [found.before[axis][record]]
    if diagnosed.final is not diagnosed.chain:
        stages.append(found.after[axis][record])
    return residual_pictures(axis, diagnosed.evidence[record].limit, *stages)


def _effects(found: ScannerDiagnosis) -> Iterator[str]:
    for effect in found.effects:
        yield text.form_text(effect)
        yield " ".join((text.share_text(effect), *text.evidence_text(effect)))
    if any(effect.periodic for effect in found.effects):
        yield sentence("diagnosis.convention")


def _residual(found: ResidualReport, axis: str) -> Iterator[str]:
    yield text.described(found, axis)
    diagnosed = found.diagnosis.by_axis[axis]
    if diagnosed.final is not diagnosed.chain:
        record = most_excited_record(diagnosed)
        after, limit = found.after[axis][record], diagnosed.evidence[record].limit
        yield sentence("residual.extended", said=residual_text(after, limit))


def write_diagnosis(
    folder: Path, found: ResidualReport, heading: str, of: Provenance, figures: str | None
) -> None:
    """Write all files of a diagnosis; ``heading`` begins the comment at the head of the model's.

    ``figures`` is the format of the pictures beside the report, if there are to be any.
    """
    save_diagnosis(folder / "diagnosis.json", {**account_document(found), "provenance": plain(of)})
    head = f"{heading}\n{heading_lines(of)}"
    save_model(folder / "model.extended.yaml", found.diagnosis.model, head)
    diagnosis_report(found, of).write(folder / "report.html", figures)


COUPLED_ROWS = ("effect", "probability", "share of the residual's\nmean square, %")
RESIDUALS = ("axis", "residual, model,\nrms in nm", "with the effects", "detection\nlimit")


def coupled_result(found: CoupledDiagnosis) -> Iterator[Part]:
    """Yield verdict, effects, probabilities and residuals."""
    yield sentence(f"verdict.{found.verdict}")
    if found.effects:
        shares = [(e, significant(100.0 * e.explained_fraction)) for e in found.effects]
        named = [(e.name, probability(e.probability), share) for e, share in shares]
        yield Rows(COUPLED_ROWS, named)
    yield from text.probabilities(found)
    figures = found.rms_before, found.rms_after, found.noise_floor
    left = [(axis, *(nanometres(of[axis]) for of in figures)) for axis in found.base.axes]
    yield Rows(RESIDUALS, left)
    yield sentence("residual.of_last_records")


def next_coupled_record(found: CoupledDiagnosis) -> str | None:
    """Say what to record to resolve an ambiguous case; None where nothing is."""
    if found.verdict not in (AMBIGUOUS, UNEXPLAINED):
        return None
    sets = found.posterior.credible(SEARCH.certain) if found.verdict == AMBIGUOUS else ()
    names = {name for names in sets if names != OUTSIDE for name in names}
    needs = {e.needs for e in COUPLED_EFFECTS if e.feedback and e.name in names}
    wanted = "; ".join(sorted(needs)) or "steady periods at further amplitudes"
    return sentence("next.realisations", wanted=wanted)


def coupled_next_steps(found: CoupledDiagnosis) -> Iterator[str]:
    """Yield what to do next."""
    if said := next_coupled_record(found):
        yield said
    elif found.verdict == SUFFICIENT:
        yield sentence("next.coupled_sufficient")
    else:
        yield sentence("next.coupled_extended")
    yield from (text.remedy_text(e) for e in COUPLED_EFFECTS if e.name in found.selected)


def write_coupled(folder: Path, found: CoupledDiagnosis, heading: str, of: Provenance) -> None:
    """Write diagnosis.json, the extended model and the report."""
    save_diagnosis(folder / "diagnosis.json", {**coupled_document(found), "provenance": plain(of)})
    save_coupled(folder / "model.extended.yaml", found.model, f"{heading}\n{heading_lines(of)}")
    coupled_report(found, of).write(folder / "report.html", None)


def coupled_report(found: CoupledDiagnosis, of: Provenance) -> ReportPage:
    """Return the report on a diagnosis of coupled axes, which has no picture."""
    verdict, *rest = coupled_result(found)
    return ReportPage(
        title="Diagnosis of coupled axes",
        answer=[str(verdict), *_change(found)],
        picture=None,
        next_steps=list(coupled_next_steps(found)),
        evidence=[
            Section("Effects, probabilities and residuals", rest),
            Section("Alternatives", [Rows(text.TRIED, _alternatives(found))]),
            Section("Method", [sentence("diagnosis.coupled_method")]),
        ],
        warnings=of.shortcomings,
        provenance=of,
    )


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
                "why_not": text.why_not_text(other),
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
            sentence("evidence.unseen", of=of),
            sentence("evidence.likelihood", of=of),
            sentence("evidence.largest_band", of=of),
        ],
    }


def _alternatives(found: CoupledDiagnosis) -> list[tuple[str, ...]]:
    return [
        (other.name, other.axis, probability(other.probability), text.why_not_text(other))
        for other in found.alternatives
    ]
