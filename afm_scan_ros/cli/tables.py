"""Options of commands that read bags and tables, and the records that they read."""

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click
from attrs import evolve, frozen

from afm_scan_ros.api.record import Record, is_table, read_record
from afm_scan_ros.bag.reader import TYPES
from afm_scan_ros.cli.options import positive
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.columns import Column, parse_columns


@frozen
class TableOptions:
    """What files do not state: columns, sample rate in Hz, lines above the rows; a bag's topics."""

    columns: str | None = None
    sample_rate: float | None = None
    skip_rows: int = 0
    topics: Mapping[str, str] = MappingProxyType({})

    @property
    def parsed(self) -> tuple[Column, ...] | None:
        """The columns; None where the headings are to state them."""
        return None if self.columns is None else parse_columns(self.columns)

    def read(self, path: Path) -> Record:
        """Read a record."""
        if not is_table(path):
            return read_record(path, topics=self.topics)
        if self.topics:
            raise InputError(f"{path}: a table has no topics: leave --topic out")
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


def _parsed_topics(
    ctx: click.Context, param: click.Parameter, given: Sequence[str]
) -> Mapping[str, str]:
    """Return the topics by the names of their streams."""
    found = {}
    for text in given:
        name, _, topic = text.partition("=")
        if name not in TYPES or not topic.startswith("/"):
            known = ", ".join(TYPES)
            raise click.BadParameter(f"{text}: give NAME=/TOPIC, NAME of {known}", ctx, param)
        found[name] = topic
    return found


def topic_option(command: Callable[..., None]) -> Callable[..., None]:
    """Add what bags do not say themselves to a command, which gets it as ``topics``."""
    return click.option(
        "--topic",
        "topics",
        metavar="NAME=/TOPIC",
        multiple=True,
        callback=_parsed_topics,
        help="Topic of a bag that is achieved_displacement, drive_voltage, desired_displacement or"
        " scan_info. Not needed where its name or its message type says it.",
    )(command)


def record_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add what tables and bags do not say themselves to a command, which gets it as ``tables``."""

    @table_options
    @topic_option
    @wraps(command)
    def with_topics(
        tables: TableOptions,
        topics: Mapping[str, str],
        **options: Any,  # noqa: ANN401 - the command's own
    ) -> None:
        command(tables=evolve(tables, topics=topics), **options)

    return with_topics
