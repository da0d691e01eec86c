"""Options of commands that read tables, and the records that they read."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click
from attrs import frozen

from afm_scan_ros.api.reading import is_table, read_record
from afm_scan_ros.api.record import Record
from afm_scan_ros.cli.options import positive
from afm_scan_ros.files.columns import Column, parse_columns


@frozen
class TableOptions:
    """What tables do not state themselves: columns, sample rate in Hz, lines above the rows."""

    columns: str | None = None
    sample_rate: float | None = None
    skip_rows: int = 0

    @property
    def parsed(self) -> tuple[Column, ...] | None:
        """The columns; None where the headings are to state them."""
        return None if self.columns is None else parse_columns(self.columns)

    def read(self, path: Path) -> Record:
        """Read a record; a bag needs no options."""
        if not is_table(path):
            return read_record(path)
        return read_record(
            path, self.columns, sample_rate=self.sample_rate, skip_rows=self.skip_rows
        )


def table_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add options for what tables do not state to a command, which gets it as ``tables``."""

    @click.option(
        "--columns",
        help="What the columns of tables hold: NAME=COLUMN:UNIT, separated by commas. NAME is time,"
        " or drive, achieved or desired with _x or _y. COLUMN is a number from 1 or a heading, UNIT"
        " one as mV, nm, -um or 8um/V. Not needed where the headings state it, as 'drive_x [V]'.",
    )
    @click.option("--sample-rate", type=positive("Hz"), help="If no column is time, as 20kHz.")
    @click.option(
        "--skip-rows",
        type=click.IntRange(0),
        default=0,
        help="Lines to skip at the top of tables. A heading is found without.",
    )
    @wraps(command)
    def with_tables(
        columns: str | None,
        sample_rate: float | None,
        skip_rows: int,
        **options: Any,  # noqa: ANN401 - the command's own
    ) -> None:
        command(tables=TableOptions(columns, sample_rate, skip_rows), **options)

    return with_tables
