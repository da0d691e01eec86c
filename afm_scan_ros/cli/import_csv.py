"""``afm-scan import-csv``: measured data that no ROS recorded, as a bag."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import click
import numpy as np

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.options import FILE, RECORD, warn
from afm_scan_ros.cli.tables import TableOptions, table_options
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS
from afm_scan_ros.core.identification.records.recording import kind_of, problems
from afm_scan_ros.core.scan_spec import PATTERNS
from afm_scan_ros.core.streams import part
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.files.columns import TableRecord, read_table_record
from afm_scan_ros.files.text_table import Rows

BLOCK = 1000
STREAM = {
    "drive": "drive_voltage",
    "achieved": "achieved_displacement",
    "desired": "desired_displacement",
}
"""Stream of a bag that each quantity becomes."""


@click.command()
@click.argument("files", nargs=-1, required=True, type=FILE)
@table_options
@click.option("--bag", required=True, type=RECORD, help="Folder to create for the bag.")
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
def import_csv(
    files: tuple[Path, ...],
    bag: Path,
    start_row: int,
    stop_row: int | None,
    record: str,
    sampling_instant: str,
    tables: TableOptions,
) -> None:
    """Convert FILES to a bag: text with any separator and heading, .npy, .npz or .mat.

    The columns of several files are numbered consecutively.
    """
    if record in PATTERNS:
        raise InputError(
            f"--record {record}: this is the name of a scan pattern: give another name"
        )
    rows = Rows(tables.skip_rows, start_row, stop_row)
    found = read_table_record(files, tables.parsed, rows, tables.sample_rate)
    axes = _axes(files[0], found)
    streams = _streams(found)
    for problem in _problems(streams, axes):
        if record in PLANS:
            raise InputError(f"{files[0]}: {problem}")
        warn([f"{files[0]}: {problem}"])
    warn(found.notes)
    info = ScanInfo(
        files[0].stem,
        start=0,
        pattern=(name := kind_of(record, axes)),
        sample_period=found.sample_period,
        total_samples=found.samples,
        sampling_instant=sampling_instant,
    )
    write_record(bag, info, streams)
    click.echo(f"{bag} holds {found.samples} samples of a record '{name}'.")
    for axis in (axis for axis in AXES if axis not in axes):
        click.echo(f"Axis {axis} was not measured: it is filled with zeros.")


def _axes(path: Path, record: TableRecord) -> tuple[str, ...]:
    """Return the axes that a record holds, which a bag can hold too."""
    for axis in record.axes:
        if axis not in AXES:
            raise InputError(
                f"{path}: a bag holds the axes x and y, not {axis}: read it in Python, with"
                " afm.read_record"
            )
    return tuple(axis for axis in AXES if axis in record.axes)


def _streams(record: TableRecord) -> dict[str, Trace]:
    """Return the streams of a bag; an absent axis is zero."""
    zeros = np.zeros(record.samples)
    return {
        STREAM[quantity]: Trace(
            0, record.sample_period, *(signals.get(axis, zeros) for axis in AXES)
        )
        for quantity, signals in record.signals.items()
    }


def _problems(streams: dict[str, Trace], axes: tuple[str, ...]) -> Iterator[str]:
    """Yield the worst that keeps a drive and its displacement from being identified."""
    if {"drive_voltage", "achieved_displacement"} <= streams.keys():
        drive, achieved = (streams[s] for s in ("drive_voltage", "achieved_displacement"))
        yield from islice(problems(drive, achieved, axes), 1)


def write_record(bag: Path, info: ScanInfo, streams: dict[str, Trace]) -> None:
    """Write streams as a bag; its time begins at 0, since the files do not state when it was."""
    with ScanWriter(bag, info) as writer:
        for first in range(0, info.total_samples, BLOCK):
            for stream, trace in streams.items():
                stop = min(first + BLOCK, info.total_samples)
                writer.add(stream, part(trace, first, stop))
