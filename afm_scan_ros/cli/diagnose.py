"""``afm-scan diagnose``: the effect that a model lacks, from the residual of records."""

from pathlib import Path

import click
from attrs import evolve

from afm_scan_ros.api import diagnosis as api
from afm_scan_ros.api.model import load_model
from afm_scan_ros.cli.options import FILE, FOLDER, RECORD, positive, refuse_existing
from afm_scan_ros.cli.tables import TableOptions, record_options
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.diagnosis.experiments import LONGEST
from afm_scan_ros.report.diagnosis_text import next_steps, result, unexplained_text
from afm_scan_ros.report.table import show


@click.command()
@click.argument("bags", nargs=-1, required=True, type=RECORD, metavar="BAG...")
@click.option(
    "--model",
    required=True,
    type=FILE,
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
    type=FOLDER,
    help="Folder for diagnosis.json, model.extended.yaml, report.html and its pictures.",
)
@click.option(
    "--longest",
    type=positive("s"),
    default=f"{LONGEST:g}s",
    show_default=True,
    help="Length of the proposed experiment, at most.",
)
@click.option(
    "--depolarised",
    is_flag=True,
    help="Every BAG begins depolarised. By default its initial hysteresis state is estimated.",
)
@record_options
def diagnose(
    bags: tuple[Path, ...],
    model: Path,
    healthy: tuple[Path, ...],
    out: Path,
    longest: float,
    tables: TableOptions,
    *,
    depolarised: bool,
) -> None:
    """Identify the effect that a model lacks, from the residual of records.

    A BAG is a rosbag2 folder or an .mcap file with drive_voltage and achieved_displacement, or a
    table of drive and displacement.
    """
    refuse_existing(out / "diagnosis.json")
    base = load_model(model)
    records, well = ([tables.read(bag) for bag in some] for some in (bags, healthy))
    if depolarised:
        records = [evolve(record, start="depolarised") for record in records]
    with working("diagnosing") as progress:
        found = api.diagnose(base, records, well, progress, longest)
    found.save(out)
    diagnosis = found.residual_report.diagnosis
    show(result(diagnosis))
    show(unexplained_text(found.residual_report))
    show(f"next: {step}" for step in next_steps(diagnosis))
    click.echo(f"Report: {out / 'report.html'}. JSON, extended model and figures are beside it.")
