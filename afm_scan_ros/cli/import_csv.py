"""``afm-scan import-csv``: measured data that no ROS recorded, as a bag."""

import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import click

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.align import part
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS
from afm_scan_ros.core.identification.records.checks import problems
from afm_scan_ros.core.identification.records.recording import kind_of
from afm_scan_ros.core.scan_spec import PATTERNS
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.csv_record import Rows, TableRecord, parse_columns, read_table_record

BLOCK = 1000


@click.command()
@click.argument(
    "files",
    nargs=-1,
    required=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)
@click.option(
    "--columns",
    required=True,
    help="NAME=COLUMN:UNIT, separated by commas. NAME is time, or drive, achieved or desired with"
    " _x or _y. COLUMN is a number from 1, or a name in the last skipped line.",
)
@click.option(
    "--bag", required=True, type=click.Path(path_type=Path), help="Folder to create for the bag."
)
@click.option("--sample-rate", type=float, help="Sample rate in Hz, if no column is time.")
@click.option(
    "--axis-absent",
    type=click.Choice(AXES),
    help="Axis that was neither driven nor measured; it is filled with zeros.",
)
@click.option("--skip-rows", type=click.IntRange(0), default=0, help="Lines to skip at the top.")
@click.option(
    "--start-row", type=click.IntRange(1), default=1, help="First row to import, counted from 1."
)
@click.option("--stop-row", type=click.IntRange(1), help="Last row to import.")
@click.option(
    "--record",
    default="imported",
    show_default=True,
    help="Kind of record: creep, frequency, hysteresis or validation for an identification.",
)
@click.option(
    "--sampling-instant",
    type=click.Choice(("before_update", "after_update")),
    default="before_update",
    show_default=True,
    help="When the sensor was read, relative to the converter's update.",
)
def import_csv(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    files: tuple[Path, ...],
    columns: str,
    bag: Path,
    sample_rate: float | None,
    axis_absent: str | None,
    skip_rows: int,
    start_row: int,
    stop_row: int | None,
    record: str,
    sampling_instant: str,
) -> None:
    """Convert FILES to a bag: text with any separator, or .npy arrays with samples along axis 0.

    The columns of several files are numbered consecutively.
    """
    if sample_rate is not None and not (sample_rate > 0.0 and math.isfinite(sample_rate)):
        raise InputError(f"--sample-rate {sample_rate:g}: give a positive number of Hz")
    if record in PATTERNS:
        raise InputError(
            f"--record {record}: this is the name of a scan pattern: give another name"
        )
    rows = Rows(skip_rows, start_row, stop_row)
    found = read_table_record(
        files, parse_columns(columns), rows, sample_rate=sample_rate, absent=axis_absent
    )
    axes = tuple(axis for axis in AXES if axis != axis_absent)
    name = kind_of(record, axes)
    for problem in _problems(found, axes):
        if record in PLANS:
            raise InputError(f"{files[0]}: {problem}")
        click.echo(f"warning: {files[0]}: {problem}", err=True)
    write_record(bag, files[0].stem, name, found, sampling_instant)
    click.echo(f"{bag} holds {found.samples} samples of a record '{name}'.")
    if axis_absent is not None:
        click.echo(f"Axis {axis_absent} was not measured: it is filled with zeros.")


def _problems(record: TableRecord, axes: tuple[str, ...]) -> Iterator[str]:
    """Yield the worst that keeps a drive and its displacement from being identified."""
    if {"drive_voltage", "achieved_displacement"} <= record.streams.keys():
        drive, achieved = (record.streams[s] for s in ("drive_voltage", "achieved_displacement"))
        yield from islice(problems(drive, achieved, axes), 1)


def write_record(bag: Path, scan_id: str, name: str, record: TableRecord, instant: str) -> None:
    """Write a record as a bag; its time begins at 0, since the files do not say when it was."""
    info = ScanInfo(
        scan_id,
        start=0,
        pattern=name,
        sample_period=record.sample_period,
        total_samples=record.samples,
        sampling_instant=instant,
    )
    with ScanWriter(bag, info) as writer:
        for first in range(0, record.samples, BLOCK):
            for stream, trace in record.streams.items():
                writer.add(stream, part(trace, first, min(first + BLOCK, record.samples)))
