"""``afm-scan diagnose``: from a residual to the effect that the model lacks."""

from pathlib import Path

import click

from afm_scan_ros.api import diagnosis as api
from afm_scan_ros.api.model import load_model
from afm_scan_ros.api.reading import read_record
from afm_scan_ros.cli.text_table import show_table
from afm_scan_ros.cli.working import working
from afm_scan_ros.core.diagnosis.account import Account
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.diagnosis_file import proposal
from afm_scan_ros.report.diagnosis_words import (
    EFFECTS,
    RESIDUAL,
    UNSEEN,
    conclusions,
    effect_rows,
    residual_rows,
    unexplained_words,
)


@click.command()
@click.argument("bags", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="BAG...")
@click.option(
    "--model",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="What was believed of the scanner: a model file with its known error.",
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
    records = [read_record(bag) for bag in bags]
    with working("tracing the residual") as progress:
        found = api.diagnose(base, records, progress)
    found.save(out)
    _show(found.account)
    click.echo(f"{out / 'report.html'} shows it all; JSON, extended model and pictures beside it.")


def _show(found: Account) -> None:
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
