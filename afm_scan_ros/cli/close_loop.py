"""``afm-scan close-loop``: scan, find what the model lacks, extend it, and scan again."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import click

from afm_scan_ros.cli.driving import DrivenScanner, RecordedSession, driven_options
from afm_scan_ros.cli.options import CONFIG, FIGURES, FILE, FOLDER, refuse_existing
from afm_scan_ros.cli.progress import working
from afm_scan_ros.cli.scanner import SIM
from afm_scan_ros.core.closed_loop import Round, validation_specs
from afm_scan_ros.core.closed_loop import close_loop as rounds_of
from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.diagnosis.residual_report import report_residual
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.files.plant_file import load_plant, load_scan
from afm_scan_ros.nodes.parameters import FLOW
from afm_scan_ros.report.close_loop import close_loop_report, final_text, reported, round_result
from afm_scan_ros.report.diagnosis_json import closed_loop_document, diagnosis_of, save_diagnosis
from afm_scan_ros.report.diagnosis_page import write_diagnosis
from afm_scan_ros.report.diagnosis_text import next_steps
from afm_scan_ros.report.page import Provenance, Source, heading_lines, provenance_of
from afm_scan_ros.report.table import show
from afm_scan_ros.report.terminal import say

HEADING = "A scanner's model with the effects that 'afm-scan close-loop' identified."


@click.command()
@click.option(
    "--spec", type=FILE, default=CONFIG / "scan.yaml", help="Scan that is diagnosed and repeated."
)
@click.option("--model", type=FILE, default=CONFIG / "model.yaml", help="Model file to extend.")
@driven_options
@click.option(
    "--out",
    required=True,
    type=FOLDER,
    help="Folder for report.html, diagnosis.json, model.extended.yaml, bags.",
)
@click.option(
    "--rounds",
    type=click.IntRange(min=1),
    default=3,
    show_default=True,
    help="Largest number of rounds.",
)
@FIGURES
def close_loop(
    spec: Path,
    model: Path,
    driven: DrivenScanner,
    out: Path,
    rounds: int,
    figures: str | None,
) -> None:
    """Scan, diagnose what the model lacks, extend the model, and scan again with its inverse.

    The scan of --spec is diagnosed. It and three others are made before and after: another rate,
    another amplitude, another pattern. An extended model that makes any of them worse is not kept.
    """
    base = _base_model(model)
    diagnosed, _ = load_scan(spec, [parameter.name for parameter in FLOW])
    if driven.scanner == SIM:
        load_plant(driven.plant)
    refuse_existing(out / "bags")
    session = RecordedSession(driven, out)
    done: list[Round] = []

    def provenance(records: Sequence[Source]) -> Provenance:
        return provenance_of(model, base, records, datetime.now(UTC))

    try:
        for each in rounds_of(session, base, validation_specs(diagnosed), rounds, _diagnose):
            done.append(each)
            say(f"round {len(done)}: {each.diagnosis.verdict.replace('_', ' ')}")
            show(round_result(each))
            of = provenance(_diagnosed(each, session.sources))
            with working(f"reporting round {len(done)}", at_once=False):
                described = report_residual(each.diagnosis)
                write_diagnosis(out / f"round_{len(done)}", described, HEADING, of, figures)
    except (InputError, ScanError) as error:
        if done:
            _conclude(out, done, provenance(session.sources), figures, str(error))
        raise
    _conclude(out, done, provenance(session.sources), figures)
    first = done[0]
    if not first.improved and first.diagnosis.verdict != SUFFICIENT:
        raise ScanError(_shortcoming(first))


def _diagnosed(done: Round, recorded: Sequence[Source]) -> list[Source]:
    """Return the records that a round's diagnosis used."""
    names = {Path(observed.name).name for observed in done.diagnosis.observations}
    return [source for source in recorded if Path(source.bag).name in names]


def _base_model(path: Path) -> ScannerModel:
    """Load a model that states its discrepancy, which the detection limit needs."""
    model = load_model(path)
    for axis in AXES:
        if axis not in model.axes:
            raise InputError(f"{path}: holds no axis {axis}, which a scan moves: identify it too")
        if not model.axis(axis).model_discrepancies:
            raise InputError(
                f"{path}: {axis}: model_discrepancy is missing: identify the scanner again, with a"
                " validation record"
            )
    return model


def _diagnose(model: ScannerModel, records: Sequence[Record]) -> ScannerDiagnosis:
    with working("diagnosing") as progress:
        return diagnose(model, records, progress)


def _conclude(
    out: Path, done: Sequence[Round], of: Provenance, figures: str | None, failure: str = ""
) -> None:
    """Write and print the results of the rounds; ``failure`` is what ended the next, if any."""
    made = {"provenance": plain(of)}
    save_diagnosis(out / "diagnosis.json", {**diagnosis_of(done), **made})
    save_diagnosis(out / "closed_loop.json", {**closed_loop_document(done, failure), **made})
    with working("writing the report", at_once=False):
        close_loop_report(done, of, failure).write(out / "report.html", figures)
    kept = [each.diagnosis.model for each in done if each.kept]
    model, head = kept[-1] if kept else done[0].model, f"{HEADING}\n{heading_lines(of)}"
    save_model(out / "model.extended.yaml", model, head)
    show(final_text(done, failure))
    show(f"next: {step}" for step in next_steps(reported(done).diagnosis))
    say(f"Report: {out / 'report.html'}. JSON, models and bags are in the same folder.")


def _shortcoming(done: Round) -> str:
    found = done.diagnosis
    steps = "; ".join(next_steps(found)) or "see the report"
    verdict = found.verdict.replace("_", " ")
    return f"no extended model reduced the tracking error; verdict {verdict}: {steps}"
