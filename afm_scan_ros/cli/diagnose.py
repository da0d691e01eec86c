"""``afm-scan diagnose``: the effect that a model lacks, from the residual of records."""

from datetime import UTC, datetime
from pathlib import Path

import click

from afm_scan_ros.bag.observed import observed
from afm_scan_ros.bag.reader import Recording, read_scan
from afm_scan_ros.bag.same_scan import refuse_same
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.diagnosis.account import Account, account
from afm_scan_ros.core.diagnosis.diagnosis import diagnose as diagnose_records
from afm_scan_ros.core.diagnosis.match import refuse_foreign
from afm_scan_ros.core.diagnosis.observation import Observation
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.report.diagnosis_page import write_diagnosis
from afm_scan_ros.report.diagnosis_text import (
    EFFECTS,
    HELD_OUT,
    RESIDUAL,
    effect_rows,
    limits_text,
    next_steps,
    residual_rows,
    unexplained_text,
    verdict_text,
)
from afm_scan_ros.report.provenance import Source, provenance_of, source_of
from afm_scan_ros.report.table import show_rows

HEADING = (
    "A scanner's model with the effects that 'afm-scan diagnose' identified. The verdict is in"
    " diagnosis.json beside it. Where it is ambiguous, another effect may be the cause."
)


@click.command()
@click.argument("bags", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="BAG...")
@click.option(
    "--model",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="Model file of the scanner, with its model discrepancy (known_error).",
)
@click.option(
    "--out",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for diagnosis.json, model.extended.yaml, report.html and its pictures.",
)
def diagnose(bags: tuple[Path, ...], model: Path, out: Path) -> None:
    """Identify the effect that a model lacks, from the residual of records.

    A BAG is a rosbag2 folder or an .mcap file with drive_voltage and achieved_displacement.
    """
    if (written := out / "diagnosis.json").exists():
        raise InputError(f"{written} exists already: give another folder or remove it")
    base = load_model(model)
    recordings = [read_scan(bag) for bag in bags]
    records, sources = zip(*(_record(each, base) for each in recordings), strict=True)
    refuse_same([each.info for each in recordings], records)
    try:
        with working("diagnosing") as progress:
            diagnosis = diagnose_records(base, records, progress)
            progress("describing the residual")
            found = account(diagnosis)
    except InputError as error:
        raise InputError(f"{model}: {error}") from error
    write_diagnosis(out, found, HEADING, provenance_of(model, base, sources, datetime.now(UTC)))
    _show(found)
    click.echo(f"Report: {out / 'report.html'}. JSON, extended model and figures are beside it.")


def _record(recording: Recording, model: ScannerModel) -> tuple[Observation, Source]:
    record = observed(recording)
    shortcomings = list(recording.warnings)
    missing = recording.info.total_samples - len(record.drive.x)
    if missing:
        shortcomings.append(f"{recording.path}: the last {missing} samples are missing")
    for shortcoming in shortcomings:
        click.echo(f"warning: {shortcoming}", err=True)
    refuse_foreign(model, record)
    return record, source_of(recording, len(record.drive.x), shortcomings)


def _show(found: Account) -> None:
    diagnosis = found.diagnosis
    for sentence in verdict_text(diagnosis):
        click.echo(sentence)
    if diagnosis.effects:
        show_rows(EFFECTS, effect_rows(diagnosis))
    show_rows(RESIDUAL, residual_rows(diagnosis))
    click.echo(HELD_OUT)
    for sentence in (*limits_text(diagnosis), *unexplained_text(found)):
        click.echo(sentence)
    for step in next_steps(diagnosis):
        click.echo(f"next: {step}")
