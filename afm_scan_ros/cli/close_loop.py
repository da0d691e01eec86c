"""``afm-scan close-loop``: scan, trace the residual, extend the model, and scan again."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import click

from afm_scan_ros.cli.scan import CONFIG
from afm_scan_ros.cli.session import NodeSession
from afm_scan_ros.cli.text_table import show_table
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.closed_loop.loop import Round
from afm_scan_ros.core.closed_loop.loop import close_loop as rounds_of
from afm_scan_ros.core.closed_loop.test_scans import test_specs
from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT
from afm_scan_ros.core.diagnosis.diagnosis import Diagnosis, diagnose
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.residual_report import report_residual
from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.closed_loop_file import closed_loop_document, diagnosis_of
from afm_scan_ros.files.diagnosis_file import proposal, save_diagnosis
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.scan_file import load_scan
from afm_scan_ros.nodes.block_source import FLOW
from afm_scan_ros.report.close_loop_page import close_loop_page
from afm_scan_ros.report.close_loop_words import TRACKING, final_words, outcome, tracking_rows
from afm_scan_ros.report.diagnosis_folder import write_diagnosis
from afm_scan_ros.report.diagnosis_words import EFFECTS, effect_rows
from afm_scan_ros.report.provenance import Provenance, Source, heading_lines, provenance_of

HEADING = "A scanner's model with the effects that 'afm-scan close-loop' found and kept."
_FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.option("--spec", type=_FILE, default=CONFIG / "scan.yaml", help="Scan that teaches.")
@click.option("--model", type=_FILE, default=CONFIG / "model.yaml", help="What is believed.")
@click.option("--plant", type=_FILE, default=CONFIG / "plant.yaml", help="What is simulated.")
@click.option(
    "--out",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for report.html, diagnosis.json, model.extended.yaml, bags.",
)
@click.option(
    "--rounds", type=click.IntRange(min=1), default=3, show_default=True, help="At most so many."
)
@click.option("--seed", default=1, show_default=True, help="Seed of the sensor's noise.")
def close_loop(spec: Path, model: Path, plant: Path, out: Path, rounds: int, seed: int) -> None:
    """Scan, trace what the model lacks, extend it, and scan again with its inverse.

    The scan of --spec teaches; it and three others, of another rate, amplitude and pattern, are
    made before and after. An extended model that follows any of them worse is not kept.
    """
    base = _believed(model)
    fitted, _ = load_scan(spec, [parameter.name for parameter in FLOW])
    load_plant(plant)
    if (out / "bags").exists():
        raise InputError(f"{out / 'bags'} exists already: give another folder or remove it")
    session = NodeSession(plant, out, seed)
    done: list[Round] = []

    def provenance(records: Sequence[Source]) -> Provenance:
        return provenance_of(model, base, records, datetime.now(UTC))

    try:
        for each in rounds_of(session, base, test_specs(fitted), rounds, _trace):
            done.append(each)
            _tell(len(done), each)
            of = provenance(_traced(each, session.sources))
            write_diagnosis(
                out / f"round_{len(done)}", report_residual(each.diagnosis), HEADING, of
            )
    except (InputError, ScanError) as error:
        if done:
            _conclude(out, done, provenance(session.sources), failure=str(error))
        raise
    _conclude(out, done, provenance(session.sources))
    first = done[0]
    if not first.improved and first.diagnosis.verdict != SUFFICIENT:
        raise ScanError(_shortcoming(first))


def _traced(done: Round, recorded: Sequence[Source]) -> list[Source]:
    """Of what was recorded, that which a round's diagnosis is of."""
    traced = {Path(observed.name).name for observed in done.diagnosis.observations}
    return [source for source in recorded if Path(source.bag).name in traced]


def _believed(path: Path) -> ScannerModel:
    """Load a model whose error is known, for a residual is judged by it."""
    model = load_model(path)
    for axis in AXES:
        if not model.axis(axis).model_discrepancies:
            raise InputError(
                f"{path}: {axis}: model_discrepancy is missing: identify the scanner anew, with its"
                " validation record"
            )
    return model


def _trace(model: ScannerModel, records: Sequence[Observation]) -> Diagnosis:
    with working("tracing the residual") as told:
        return diagnose(model, records, told)


def _tell(number: int, done: Round) -> None:
    click.echo(f"round {number}: {done.diagnosis.verdict.replace('_', ' ')}")
    if done.diagnosis.effects:
        show_table(EFFECTS, effect_rows(done.diagnosis))
    if done.comparisons:
        show_table(TRACKING, tracking_rows(done))
    for sentence in outcome(done):
        click.echo(sentence)


def _conclude(out: Path, done: Sequence[Round], of: Provenance, failure: str = "") -> None:
    """Write and tell what the rounds came to; ``failure`` is what ended the next, if any."""
    made = {"provenance": plain(of)}
    save_diagnosis(out / "diagnosis.json", {**diagnosis_of(done), **made})
    save_diagnosis(out / "closed_loop.json", {**closed_loop_document(done, failure), **made})
    (out / "report.html").write_text(close_loop_page(done, of, failure), "utf-8")
    kept = [each.diagnosis.model for each in done if each.kept]
    model, head = kept[-1] if kept else done[0].model, f"{HEADING}\n{heading_lines(of)}"
    save_model(out / "model.extended.yaml", model, head)
    for sentence in final_words(done, failure):
        click.echo(sentence)
    click.echo(f"{out / 'report.html'} shows it all; JSON, models and bags are beside it.")


def _shortcoming(done: Round) -> str:
    found = done.diagnosis
    limits = dict.fromkeys(f"{e.axis}: {e.name}: {entry(e.name).advice}" for e in found.effects)
    advice = proposal(found.experiment) or "; ".join(limits) or "the report says what is known"
    verdict = found.verdict.replace("_", " ")
    return f"nothing made the scanner follow better; verdict {verdict}: {advice}"
