"""``afm-scan diagnose``: from a residual to the effect that the model lacks."""

from datetime import UTC, datetime
from pathlib import Path

import click

from afm_scan_ros.bag.observed import observed
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.bag.same_scan import refuse_same
from afm_scan_ros.cli.text_table import show_table
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.diagnosis.checks import refuse_mismatch
from afm_scan_ros.core.diagnosis.diagnosis import diagnose as trace_residual
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport, report_residual
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.files.diagnosis_file import proposal
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.report.diagnosis_folder import write_diagnosis
from afm_scan_ros.report.diagnosis_words import (
    EFFECTS,
    RESIDUAL,
    UNSEEN,
    conclusions,
    effect_rows,
    residual_rows,
    unexplained_words,
)
from afm_scan_ros.report.provenance import Source, provenance_of, source_of

HEADING = (
    "A scanner's model with what its residual was traced to, by 'afm-scan diagnose'. See"
    " diagnosis.json beside it: where the verdict is ambiguous another effect may be behind it."
)


@click.command()
@click.argument("bags", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="BAG...")
@click.option(
    "--model",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="What was believed of the scanner: a model file with its model discrepancy.",
)
@click.option(
    "--out",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for diagnosis.json, model.extended.yaml, report.html and its pictures.",
)
def diagnose(bags: tuple[Path, ...], model: Path, out: Path) -> None:
    """Trace what the model leaves of the displacement in the bags to an effect that it lacks.

    A BAG is a rosbag2 folder or an .mcap file with drive_voltage and achieved_displacement.
    """
    if (written := out / "diagnosis.json").exists():
        raise InputError(f"{written} exists already: give another folder or remove it")
    base = load_model(model)
    recordings = [read_scan(bag) for bag in bags]
    records, sources = zip(*(_record(each, base) for each in recordings), strict=True)
    refuse_same([each.info for each in recordings], records)
    try:
        with working("tracing the residual") as told:
            traced = trace_residual(base, records, told)
            told("describing it")
            found = report_residual(traced)
    except InputError as error:
        raise InputError(f"{model}: {error}") from error
    write_diagnosis(out, found, HEADING, provenance_of(model, base, sources, datetime.now(UTC)))
    _show(found)
    click.echo(f"{out / 'report.html'} shows it all; JSON, extended model and pictures beside it.")


def _record(recording: ScanRecording, model: ScannerModel) -> tuple[Observation, Source]:
    record = observed(recording)
    shortcomings = list(recording.warnings)
    missing = recording.info.total_samples - len(record.drive.x)
    if missing:
        shortcomings.append(f"{recording.path}: the last {missing} samples are missing")
    for shortcoming in shortcomings:
        click.echo(f"warning: {shortcoming}", err=True)
    refuse_mismatch(model, record)
    return record, source_of(recording, len(record.drive.x), shortcomings)


def _show(found: ResidualReport) -> None:
    diagnosis = found.diagnosis
    show_table(RESIDUAL, residual_rows(diagnosis))
    click.echo(UNSEEN)
    if diagnosis.effects:
        show_table(EFFECTS, effect_rows(diagnosis))
    for sentence in (*conclusions(diagnosis), *unexplained_words(found)):
        click.echo(sentence)
    experiment = proposal(diagnosis.experiment)
    if experiment:
        click.echo(f"next: {experiment}")
