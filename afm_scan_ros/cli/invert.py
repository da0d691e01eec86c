"""``afm-scan invert``: the drive that makes a scanner follow a path, from table to table."""

from pathlib import Path

import click
import numpy as np

from afm_scan_ros.api.model import load_model
from afm_scan_ros.cli.options import FILE, quantity, refuse_existing, warn
from afm_scan_ros.cli.tables import TableOptions, table_options
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.files.columns import read_table_record
from afm_scan_ros.files.text_table import Rows


@click.command()
@click.option("--model", type=FILE, required=True, help="Model file of the scanner.")
@click.option(
    "--desired",
    type=FILE,
    required=True,
    help="Table of the path, from rest at zero: text, .npy, .npz or .mat with headings as 'time"
    " [s]' and 'desired_x [um]'.",
)
@click.option("--out", type=FILE, required=True, help="CSV file of the drive to write.")
@table_options
@click.option("--limit", type=quantity("V"), help="Voltage that the drive must not exceed.")
def invert(
    model: Path,
    desired: Path,
    out: Path,
    tables: TableOptions,
    limit: float | None,
) -> None:
    """Write the drive that makes the scanner follow a path, with all inverses of its model."""
    refuse_existing(out, other="file")
    scanner = load_model(model)
    rows = Rows(tables.skip_rows)
    found = read_table_record([desired], tables.parsed, rows, tables.sample_rate)
    warn(found.notes)
    path = found.signals.get("desired", {})
    if set(path) != set(scanner.axes):
        names = ", ".join(f"desired_{axis}" for axis in scanner.axes)
        raise InputError(f"{desired}: the model's axes ask for {names}: name these columns")
    limits = None if limit is None else DriveLimits(limit, float("inf"))
    values = np.column_stack([path[axis] for axis in scanner.axes])
    drive = scanner.invert(values, found.sample_period, limits=limits)
    _write(out, scanner.axes, found.sample_period, drive)
    extent = f"{drive.min():.4g} to {drive.max():.4g} V"
    click.echo(f"{out} holds {len(drive)} samples of the drive, {extent}.")


def _write(out: Path, axes: tuple[str, ...], period: float, drive: np.ndarray) -> None:
    heading = ",".join(["time_s", *(f"drive_{axis}_v" for axis in axes)])
    table = np.column_stack([period * np.arange(len(drive)), drive])
    out.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(out, table, fmt="%.9g", delimiter=",", header=heading, comments="")
