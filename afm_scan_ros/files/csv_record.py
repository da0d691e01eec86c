"""Columns of tables, as a person names them, to the streams of a recording in SI units."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.files.tables import NumberTable, read_table

QUANTITIES = {
    "drive": "drive_voltage",
    "achieved": "achieved_displacement",
    "desired": "desired_displacement",
}
"""Quantities that a column may hold, and the stream that each becomes."""

TIME = "time"
VOLTS = {"uV": 1e-6, "µV": 1e-6, "mV": 1e-3, "V": 1.0, "kV": 1e3}
METRES = {"pm": 1e-12, "nm": 1e-9, "um": 1e-6, "µm": 1e-6, "mm": 1e-3, "m": 1.0}
SECONDS = {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0}


@frozen
class Column:
    """A column: ``name`` as ``drive_x`` or ``time``, ``place`` (number or heading), SI scale."""

    name: str
    place: str
    scale: float


def parse_columns(text: str) -> tuple[Column, ...]:
    """Read ``NAME=PLACE:UNIT`` with commas between. Raises InputError naming the part and fix."""
    columns = tuple(_column(part.strip()) for part in text.split(","))
    names = [column.name for column in columns]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"columns: {name} is given twice: name one column for it")
    return columns


def _column(part: str) -> Column:
    name, _, rest = part.partition("=")
    place, _, unit = rest.rpartition(":")
    if not (name and place and unit):
        raise InputError(f"columns: '{part}' is not of the form NAME=COLUMN:UNIT, as drive_x=1:V")
    units = _units_of(name)
    if unit not in units:
        raise InputError(
            f"columns: {name}: '{unit}' is not a unit of it: give one of {', '.join(units)}"
        )
    return Column(name, place, units[unit])


def _units_of(name: str) -> dict[str, float]:
    quantity, _, axis = name.partition("_")
    if name == TIME:
        return SECONDS
    if quantity not in QUANTITIES or axis not in AXES:
        known = ", ".join(f"{quantity}_{axis}" for quantity in QUANTITIES for axis in AXES)
        raise InputError(f"columns: '{name}' is not a quantity: give some of {TIME}, {known}")
    return VOLTS if quantity == "drive" else METRES


UNEVEN = 0.01
"""Share of the sample period by which two samples' distance may differ from it."""
FEW = 0.25
"""Share of uneven steps up to which they are gaps, beyond which the sampling is irregular."""


@frozen
class Rows:
    """Lines left out at the top, then the first and the last row taken, counted from 1."""

    skipped: int = 0
    first: int = 1
    last: int | None = None


@frozen(eq=False)
class TableRecord:
    """Streams by name, as ``drive_voltage``: all of one length, in V or m, from sample 0."""

    sample_period: float
    streams: Mapping[str, Trace] = field(repr=False)

    @property
    def samples(self) -> int:
        """Length of each stream."""
        return len(next(iter(self.streams.values())).x)


def read_table_record(
    paths: Sequence[Path],
    columns: Sequence[Column],
    rows: Rows,
    *,
    sample_rate: float | None,
    absent: str | None,
) -> TableRecord:
    """Read files that stand side by side, the columns numbered on from one to the next.

    The sample period comes from ``sample_rate`` (Hz) or from the column ``time``, which must be
    even. Where axis ``absent`` was neither driven nor measured, all its streams are zero. Raises
    InputError naming file, place and fix for whatever is wrong or missing.
    """
    names = [column.name for column in columns]
    _refuse_unsaid(names, absent)
    if (sample_rate is None) == (TIME not in names):
        raise InputError("give either a sample rate or a column 'time', to say when samples were")
    values = _values(paths, columns, rows)
    period = 1.0 / sample_rate if sample_rate else _period(values[TIME], rows)
    zeros = np.zeros(len(values[names[0]]))
    streams = {
        stream: Trace(0, period, *(values.get(f"{quantity}_{axis}", zeros) for axis in AXES))
        for quantity, stream in QUANTITIES.items()
        if any(f"{quantity}_{axis}" in values for axis in AXES)
    }
    return TableRecord(period, streams)


def _refuse_unsaid(names: Sequence[str], absent: str | None) -> None:
    """Raise InputError unless each quantity has a column for each axis that is not absent."""
    given = [quantity for quantity in QUANTITIES if {f"{quantity}_{a}" for a in AXES} & {*names}]
    if not given:
        raise InputError("columns: names no drive and no displacement: give drive_x, achieved_x")
    for name in (f"{quantity}_{axis}" for quantity in given for axis in AXES):
        axis = name[-1]
        if axis == absent and name in names:
            raise InputError(f"columns: {name} is given, but --axis-absent {axis}: choose one")
        if axis != absent and name not in names:
            raise InputError(
                f"columns: no {name}: give it, or say --axis-absent {axis} where {axis} was"
                " neither driven nor measured"
            )


def _values(paths: Sequence[Path], columns: Sequence[Column], rows: Rows) -> dict[str, Array]:
    """Columns by name, in SI units, all of one length."""
    sources = [source for path in paths for source in _sources(read_table(path, rows.skipped))]
    values = {column.name: column.scale * _numbers(sources, column) for column in columns}
    lengths = {name: len(numbers) for name, numbers in values.items()}
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(
            f"the files differ in their number of rows: {counts}: give files of one recording"
        )
    return {name: _chosen(numbers, rows) for name, numbers in values.items()}


@frozen
class _Source:
    """A column where it stands, and its name in the heading."""

    table: NumberTable
    index: int
    name: str


def _sources(table: NumberTable) -> list[_Source]:
    named = len(table.heading) == table.width
    names = table.heading if named else ("",) * table.width
    return [_Source(table, index, name) for index, name in enumerate(names)]


def _numbers(sources: Sequence[_Source], column: Column) -> Array:
    number = int(column.place) if column.place.isdecimal() else 0
    for position, source in enumerate(sources, start=1):
        if column.place == source.name or number == position:
            return source.table.column(source.index)
    names = ", ".join(source.name for source in sources if source.name)
    raise InputError(
        f"columns: {column.name} in column {column.place}: there are columns 1 to {len(sources)}"
        + (f", named {names}" if names else "; names are read from the last line skipped")
    )


def _chosen(numbers: Array, rows: Rows) -> Array:
    last = len(numbers) if rows.last is None else rows.last
    if not 1 <= rows.first < last <= len(numbers):
        raise InputError(
            f"rows {rows.first} to {last} of {len(numbers)}: choose --start-row and --stop-row"
            " within them, with at least two rows"
        )
    return numbers[rows.first - 1 : last]


def _period(time: Array, rows: Rows) -> float:
    """Return the sample period, s, of evenly spaced times."""
    steps = np.diff(time)
    period = float((time[-1] - time[0]) / len(steps))
    if period <= 0.0:
        raise InputError(f"time falls from {time[0]:g} to {time[-1]:g} s: sort the rows by time")
    usual = float(np.median(steps)) or period
    uneven = np.flatnonzero(np.abs(steps - usual) > UNEVEN * usual)
    if uneven.size > FEW * len(steps):
        raise InputError(
            f"time is irregular: {uneven.size} of {len(steps)} steps differ by more than"
            f" {UNEVEN:.0%} from {usual:g} s, from {steps.min():g} to {steps.max():g} s: sample by"
            " a clock of even steps, or give the sample rate where the times are but rounded"
        )
    if uneven.size:
        row, step = int(uneven[0]) + rows.first, float(steps[uneven[0]])
        raise InputError(
            f"time runs {step:g} s from row {row} to row {row + 1}, elsewhere {usual:g} s: import"
            " the rows before and after separately, with --start-row and --stop-row"
        )
    return period
