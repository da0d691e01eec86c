"""``afm-scan plan``: the records that would identify a scanner, or that are still lacking."""

from collections.abc import Sequence
from pathlib import Path

import click

from afm_scan_ros.api.reading import read_record
from afm_scan_ros.cli.options import FOLDER, positive, quantity
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.proposal import (
    Converter,
    Coverage,
    combined,
    coverage,
    propose,
)
from afm_scan_ros.core.identification.drives.waypoints import Waveform
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.drive_files import make_folder, write_drives
from afm_scan_ros.report.plan_text import export_note, plan_table


def export(folder: Path, plans: Sequence[Plan[Waveform]], axes: Sequence[str]) -> None:
    """Write drives and a note on their use; report which are done.

    Raises InputError, before anything is written, where the folder cannot take them.
    """
    make_folder(folder, [plan.name for plan in plans])
    for path in write_drives(folder, plans, axes):
        click.echo(f"wrote {path}", err=True)
    rates = [(plan.name, 1.0 / plan.sample_period) for plan in plans]
    (folder / "README.md").write_text(export_note(rates, axes), "utf-8")


def _covered(record: Path) -> Coverage:
    found = read_record(record)
    pairs = zip(found.drive.T, found.displacement.T, strict=True)
    return combined(coverage(drive, moved, found.sample_period) for drive, moved in pairs)


@click.command()
@click.option(
    "--range",
    "scan_range",
    type=positive("m"),
    required=True,
    help="Largest scan. It limits the drives once a record with --have shows the gain.",
)
@click.option("--limit", type=positive("V"), required=True, help="Highest drive voltage.")
@click.option("--lowest", type=quantity("V"), help="Lowest drive voltage.  [default: -LIMIT]")
@click.option(
    "--rate", type=positive("Hz"), required=True, help="Samples a second of the converter."
)
@click.option(
    "--hold",
    type=positive("s"),
    default="5min",
    show_default=True,
    help="Hold of the creep record: it identifies time constants up to 0.57 times as long.",
)
@click.option(
    "--have",
    type=click.Path(exists=True, path_type=Path),
    multiple=True,
    help="Record at hand; give one or more. What it shows is not proposed again.",
)
@click.option(
    "--axis", type=click.Choice(AXES), multiple=True, help="Only this axis.  [default: both]"
)
@click.option(
    "--export", "folder", type=FOLDER, help="Folder for the drives as CSV and npz, and plan.json."
)
def plan(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    scan_range: float,
    limit: float,
    lowest: float | None,
    rate: float,
    hold: float,
    have: tuple[Path, ...],
    axis: tuple[str, ...],
    folder: Path | None,
) -> None:
    """Propose the shortest records that would identify a scanner within its converter's limits.

    Without a record of the frequency response, a survey is proposed first. Given with --have, it
    shows the resonance, from which the other records follow.
    """
    converter = Converter(-limit if lowest is None else lowest, limit, rate)
    held = combined(_covered(path) for path in have)
    proposed = propose(converter, hold, scan_range, held)
    if not proposed:
        click.echo("These records suffice.")
        return
    plans = [record.plan for record in proposed]
    if folder is not None:
        make_folder(folder, [each.name for each in plans])
    table = plan_table(proposed)
    table.show()
    if held.resonance is None:
        click.echo(
            "The resonance is unknown. Take the survey first, then run this command again with"
            " --have: it adds the frequency record and the validation record."
        )
    if folder is not None:
        export(folder, plans, axis or AXES)
        table.save(folder)
