"""``afm-scan diagnose``: the effect that a model lacks, from the residual of records."""

from pathlib import Path

import click

from afm_scan_ros.api import diagnosis as api
from afm_scan_ros.api.model import load_model
from afm_scan_ros.cli.tables import TableOptions, table_options
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.diagnosis.residual_report import ResidualReport
from afm_scan_ros.core.errors import InputError
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
from afm_scan_ros.report.table import show_rows


@click.command()
@click.argument("bags", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="BAG...")
@click.option(
    "--model",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="Model file of the scanner, with its model discrepancy (model_discrepancy).",
)
@click.option(
    "--healthy",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="RECORD",
    help="Record of the scanner while it was healthy, as an ordinary scan. It adds the model's"
    " error on such motion. May be given several times.",
)
@click.option(
    "--out",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for diagnosis.json, model.extended.yaml, report.html and its pictures.",
)
@table_options
def diagnose(
    bags: tuple[Path, ...], model: Path, healthy: tuple[Path, ...], out: Path, tables: TableOptions
) -> None:
    """Identify the effect that a model lacks, from the residual of records.

    A BAG is a rosbag2 folder or an .mcap file with drive_voltage and achieved_displacement, or a
    table of drive and displacement.
    """
    if (written := out / "diagnosis.json").exists():
        raise InputError(f"{written} exists already: give another folder or remove it")
    base = load_model(model)
    records, well = ([tables.read(bag) for bag in some] for some in (bags, healthy))
    with working("diagnosing") as progress:
        found = api.diagnose(base, records, well, progress)
    found.save(out)
    _show(found.residual_report)
    click.echo(f"Report: {out / 'report.html'}. JSON, extended model and figures are beside it.")


def _show(found: ResidualReport) -> None:
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
