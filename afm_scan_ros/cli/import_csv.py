"""``afm-scan import-csv`` and ``invert``: tables of data to a bag, and of a path to a drive."""

from itertools import islice
from pathlib import Path

import click
import numpy as np

from afm_scan_ros.bag.writer import write_record
from afm_scan_ros.cli import options
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS
from afm_scan_ros.core.identification.records.recording import kind_of, problems
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import PATTERNS
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.files.columns import USE_OF_PATH, TableRecord, read_table_record
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.files.text_table import RowRange
from afm_scan_ros.model import load_model
from afm_scan_ros.report.terminal import say

STREAM = {
    "drive": "drive_voltage",
    "achieved": "achieved_displacement",
    "desired": "desired_displacement",
}
"""Stream of a bag that each quantity becomes."""


@click.command()
@click.argument("files", nargs=-1, required=True, type=options.FILE)
@options.table_options
@click.option("--bag", required=True, type=options.BAG, help="Folder to create for the bag.")
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
    tables: options.TableOptions,
) -> None:
    """Convert FILES to a bag: text with any separator and heading, .npy, .npz or .mat.

    The columns of several files are numbered consecutively.
    """
    if record in PATTERNS:
        raise InputError(
            f"--record {record}: this is the name of a scan pattern: give another name"
        )
    rows = RowRange(tables.skip_rows, start_row, stop_row)
    with working("reading the table", at_once=False):
        found = read_table_record(files, tables.parsed, rows, tables.sample_rate)
    axes = _axes(files[0], found)
    streams = _streams(found)
    drive, achieved = (streams.get(STREAM[quantity]) for quantity in ("drive", "achieved"))
    if drive and achieved:
        read = Record.of_traces(str(files[0]), drive, achieved, axes=axes)
        for problem in islice(problems(read), 1):
            if record in PLANS:
                raise InputError(f"{files[0]}: {problem}")
            options.warn([f"{files[0]}: {problem}"])
    options.warn(found.notes)
    info = ScanInfo(
        files[0].stem,
        start=0,
        pattern=(name := kind_of(record, axes)),
        sample_period=found.sample_period,
        total_samples=found.samples,
        sampling_instant=sampling_instant,
    )
    with working("writing the bag", at_once=False):
        write_record(bag, info, streams)
    say(f"{bag} holds {found.samples} samples of a record '{name}'.")
    for axis in (axis for axis in AXES if axis not in axes):
        say(f"Axis {axis} was not measured: it is filled with zeros.")


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


@click.command()
@click.option("--model", type=options.FILE, required=True, help="Model file of the scanner.")
@click.option(
    "--desired",
    type=options.FILE,
    required=True,
    help="Table of the path, from rest at zero: text, .npy, .npz or .mat with headings as 'time"
    " [s]' and 'desired_x [um]'.",
)
@click.option("--out", type=options.NEW_FILE, required=True, help="CSV file of the drive to write.")
@options.table_options
@click.option("--limit", type=options.positive("V"), help="Voltage that the drive must not exceed.")
def invert(
    model: Path,
    desired: Path,
    out: Path,
    tables: options.TableOptions,
    limit: float | None,
) -> None:
    """Write the drive that makes the scanner follow a path, with all inverses of its model."""
    options.refuse_existing(out, other="file")
    scanner = load_model(model)
    rows = RowRange(tables.skip_rows)
    with working("reading the table", at_once=False):
        found = read_table_record([desired], tables.parsed, rows, tables.sample_rate, USE_OF_PATH)
    options.warn(found.notes)
    path = found.signals.get("desired", {})
    if set(path) != set(scanner.axes):
        names = ", ".join(f"desired_{axis}" for axis in scanner.axes)
        raise InputError(
            f"{desired}: the model's axes ask for {names}: name these columns, as --columns"
            " desired_x=2:um"
        )
    limits = None if limit is None else DriveLimits(limit, float("inf"))
    values = np.column_stack([path[axis] for axis in scanner.axes])
    with working("inverting", at_once=False):
        drive = scanner.invert(values, found.sample_period, limits=limits)
        _write(out, scanner.axes, found.sample_period, drive)
    extent = f"{drive.min():.4g} to {drive.max():.4g} V"
    say(f"{out} holds {len(drive)} samples of the drive, {extent}.")


def _write(out: Path, axes: tuple[str, ...], period: float, drive: np.ndarray) -> None:
    heading = ",".join(["time_s", *(f"drive_{axis}_v" for axis in axes)])
    table = np.column_stack([period * np.arange(len(drive)), drive])
    with replacing(out) as beside:
        np.savetxt(beside, table, fmt="%.9g", delimiter=",", header=heading, comments="")
