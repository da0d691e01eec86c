"""What commands share: types of options, records that they read, and warnings."""

import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from inspect import signature
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click
from attrs import evolve, frozen

from afm_scan_ros.bag.reader import TYPES
from afm_scan_ros.bag.record import is_table, read_record
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.intersample import HELD, INTERSAMPLE
from afm_scan_ros.core.record import Record
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.columns import Column, parse_columns
from afm_scan_ros.files.paths import refuse_unwritable
from afm_scan_ros.files.units import A_NUMBER, METRES, SECONDS, VOLTS, in_ascii
from afm_scan_ros.report.terminal import complain

CONFIG = share_directory() / "config"
Command = Callable[..., None]


def grouped(
    name: str, made: Callable[..., object], *options: Callable[[Command], Command]
) -> Callable[[Command], Command]:
    """Add options to a command, which gets as ``name`` what is ``made`` of their values."""
    taken = signature(made).parameters

    def with_group(command: Command) -> Command:
        @wraps(command)
        def called(**given: Any) -> None:  # noqa: ANN401 - the command's own
            own = {each: given.pop(each) for each in taken if each in given}
            command(**{name: made(**own)}, **given)

        decorated: Command = called
        for option in reversed(options):
            decorated = option(decorated)
        return decorated

    return with_group


class _Path(click.Path):
    """A path that is not empty; a ``new`` one must be where files can be written."""

    def __init__(self, *, file_okay: bool = True, dir_okay: bool = True, new: bool = False) -> None:
        super().__init__(file_okay=file_okay, dir_okay=dir_okay, path_type=Path)
        self.new = new

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401 - as click.Path does
        """Return the path; refuses it before anything is computed."""
        if not os.fspath(value):
            self.fail("the path is empty: give one", param, ctx)
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if self.new:
            refuse_unwritable(path)
        return path


FILE = _Path(dir_okay=False)
NEW_FILE = _Path(dir_okay=False, new=True)
FIGURE_FORMATS = click.Choice(["pdf", "svg", "png"])
FIGURES = click.option(
    "--figures",
    type=FIGURE_FORMATS,
    help="Write each picture of the report beside it too, as files of this format.",
)
FOLDER = _Path(file_okay=False, new=True)
"""Folder to write files to."""
RECORD = _Path()
"""A rosbag2 folder, an .mcap file, or a table of numbers."""
BAG = _Path(new=True)
"""Folder to create for a bag."""


def refuse_existing(*paths: Path, other: str = "folder") -> None:
    """Raise InputError for the first of these paths that is there already."""
    for path in paths:
        if path.exists():
            raise InputError(f"{path} exists already: give another {other} or remove it")


def refuse_over(recording: Path, *targets: Path | None) -> None:
    """Raise InputError for the first target that would overwrite a recording, or a file of it."""
    for target in targets:
        if target is None or not target.exists():
            continue
        if target.resolve().is_relative_to(recording.resolve()):
            raise InputError(f"{target} belongs to the recording {recording}: give another file")


def warn(texts: Iterable[str]) -> None:
    """Write each text as a warning on stderr."""
    for text in texts:
        complain("warning", text)


FACTORS: Mapping[str, Mapping[str, float]] = {
    "m": METRES,
    "V": VOLTS,
    "Hz": {"": 1.0, "Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "s": SECONDS | {"min": 60.0, "h": 3600.0},
}
QUANTITIES = {"m": "LENGTH", "V": "VOLTAGE", "Hz": "FREQUENCY", "s": "TIME"}
"""What the help calls a number with a unit."""
NUMBER = re.compile(rf"\s*({A_NUMBER})\s*(\S*)\s*")


def quantity(unit: str, *, above_zero: bool = False) -> Callable[[str], float]:
    """Return the type of an option that is given in ``unit``, with a prefix or not, as SI units."""
    factors = FACTORS[unit]

    def number(text: str) -> float:
        found = NUMBER.fullmatch(in_ascii(text))
        if found is None or found[2] not in factors:
            known = ", ".join(filter(None, factors))
            raise click.BadParameter(f"'{text}' is not a number with a unit: give one of {known}")
        value = float(found[1]) * factors[found[2]]
        if not math.isfinite(value):
            raise click.BadParameter(f"'{text}' is not finite: give a finite number")
        if above_zero and value <= 0.0:
            raise click.BadParameter(f"'{text}' is not above zero: give a positive number")
        return value

    number.__name__ = QUANTITIES[unit]
    return number


def positive(unit: str) -> Callable[[str], float]:
    """Return the type of an option as ``quantity`` does; it must be above zero."""
    return quantity(unit, above_zero=True)


@frozen
class TableOptions:
    """What files do not state.

    Of tables these are the columns, the sample rate in Hz and the lines above the rows, of bags the
    topics; of both how the record begins, and how its drive runs between samples.
    """

    columns: str | None = None
    sample_rate: float | None = None
    skip_rows: int = 0
    topics: Mapping[str, str] = MappingProxyType({})
    depolarised: bool = False
    intersample: str = HELD

    @property
    def parsed(self) -> tuple[Column, ...] | None:
        """The columns; None where the headings are to state them."""
        return None if self.columns is None else parse_columns(self.columns)

    def read(self, path: Path) -> Record:
        """Read a record."""
        found = self._read(path)
        start = "depolarised" if self.depolarised else found.start
        return evolve(found, start=start, intersample=self.intersample)

    def _read(self, path: Path) -> Record:
        if not is_table(path):
            return read_record(path, topics=self.topics)
        if self.topics:
            raise InputError(f"{path}: a table has no topics: leave --topic out")
        return read_record(
            path, self.columns, sample_rate=self.sample_rate, skip_rows=self.skip_rows
        )


TABLE = (
    click.option(
        "--columns",
        help="What the columns of tables hold: NAME=COLUMN:UNIT, separated by commas. NAME is time,"
        " or drive, achieved or desired with _x or _y. COLUMN is a number from 1 or a heading, UNIT"
        " one as mV, nm, -um or 8um/V. Not needed where the headings state it, as 'drive_x [V]'.",
    ),
    click.option("--sample-rate", type=positive("Hz"), help="If no column is time, as 20kHz."),
    click.option(
        "--skip-rows",
        type=click.IntRange(0),
        default=0,
        help="Lines to skip at the top of tables. A heading is found without.",
    ),
)


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


topic_option = click.option(
    "--topic",
    "topics",
    metavar="NAME=/TOPIC",
    multiple=True,
    callback=_parsed_topics,
    help="Topic of a bag that is achieved_displacement, drive_voltage, desired_displacement or"
    " scan_info. Not needed where its name or its message type says it.",
)
table_options = grouped("tables", TableOptions, *TABLE)
"""What tables do not state."""
UNSTATED = (
    click.option(
        "--depolarised",
        is_flag=True,
        help="Records begin depolarised. By default their initial hysteresis state is estimated.",
    ),
    click.option(
        "--intersample",
        type=click.Choice(INTERSAMPLE),
        default=HELD,
        show_default=True,
        help="How drives run between their samples: held by a converter, or band-limited where they"
        " were measured behind an anti-aliasing filter.",
    ),
)
record_options = grouped("tables", TableOptions, *TABLE, topic_option, *UNSTATED)
"""What tables and bags do not state."""
