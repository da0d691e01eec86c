"""What the columns of tables hold: read as a recording in SI units, and written with headings."""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.timing import timing_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.files.records import naming
from afm_scan_ros.files.tables import NumberTable, read_table
from afm_scan_ros.files.text_table import EVERY, RowRange
from afm_scan_ros.files.units import (
    METRES,
    SECONDS,
    UNITS,
    VOLTS,
    bare_unit,
    factor_of,
    name_and_unit,
)

TIME = "time"
QUANTITIES = {"drive": VOLTS, "achieved": METRES, "desired": METRES}
"""Quantities that a column may hold of an axis, as ``drive_x``, and their units."""
FORM = re.compile(rf"(?P<quantity>{'|'.join(QUANTITIES)})_(?P<axis>[^\W_]+)")
WORDS = {"desired": {"desired", "target", "reference", "setpoint", "command", "commanded"}}
"""Words of a heading in metres that make it another quantity than ``achieved``."""
AXIS = re.compile(r"(?:^|[^a-z])[uv]?([xyz])(?:[^a-z]|$)")
"""Letter of an axis in a heading in small letters, as ``x position`` or ``vx``."""
USE = "name columns, as --columns time=1:s,drive_x=2:V,achieved_x=3:um"
USE_OF_PATH = "name columns, as --columns time=1:s,desired_x=2:um"
"""The same for a table of a path."""


@frozen
class Column:
    """A column: ``name`` as ``drive_x`` or ``time``, ``place`` (number or heading), its unit.

    Where the unit is empty, the heading must have one.
    """

    name: str
    place: str
    unit: str


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
    place, colon, unit = rest.rpartition(":") if ":" in rest else (rest, "", "")
    if not (name and place) or (colon and not unit):
        raise InputError(f"columns: '{part}' is not of the form NAME=COLUMN:UNIT, as drive_x=1:V")
    if unit:
        factor_of(unit, _units_of(name), f"columns: {name}")
    else:
        _units_of(name)
    return Column(name, place, unit)


def _units_of(name: str) -> Mapping[str, float]:
    if name == TIME:
        return SECONDS
    form = FORM.fullmatch(name)
    if form is None:
        known = ", ".join(f"{quantity}_{axis}" for quantity in QUANTITIES for axis in "xy")
        raise InputError(f"columns: '{name}' is not a quantity: give some of {TIME}, {known}")
    return QUANTITIES[form["quantity"]]


@frozen
class _Source:
    """A column where it stands: its heading as it is, and without its unit."""

    table: NumberTable
    index: int
    heading: str
    name: str
    unit: str


def _sources(tables: Sequence[NumberTable]) -> list[_Source]:
    """Return the columns of tables joined column-wise, numbered on from one to the next."""
    return [
        _Source(table, index, heading, *name_and_unit(heading))
        for table in tables
        for index, heading in enumerate(table.names or table.width * ("",))
    ]


def _named(sources: Sequence[_Source]) -> tuple[Column, ...]:
    """Return the columns whose headings are quantities, as ``drive_x [V]``, and their time.

    None where no heading is drive or displacement.
    """
    known = [s for s in sources if s.name == TIME or FORM.fullmatch(s.name)]
    if all(s.name == TIME for s in known):
        return ()
    return tuple(Column(s.name, s.name, "") for s in known)


def _by_units(sources: Sequence[_Source], use: str) -> tuple[Column, ...]:
    """Return the columns by the units in their headings, as ``Voltage (V)``.

    A voltage is the drive and a length the displacement, of the axis whose letter the heading
    holds, or of ``x``. Raises InputError, which tells the ``use`` of names, unless there are drives
    and displacements of the same axes, each once.
    """
    found = tuple(Column(_by_unit(s), s.heading, "") for s in sources if bare_unit(s.unit))
    names = [column.name for column in found]
    drives, moved = (
        {name.partition("_")[2] for name in names if name.startswith(quantity)}
        for quantity in ("drive", "achieved")
    )
    if drives and drives == moved and len(set(names)) == len(names):
        return found
    headings = ", ".join(s.heading for s in sources if s.heading)
    there = f"its headings are {headings}" if headings else "it has no headings"
    unknown = ", ".join(f"'{s.unit}'" for s in sources if s.unit and not bare_unit(s.unit))
    units = f"{unknown} is none of the units {', '.join(UNITS)}; " if unknown else ""
    raise InputError(
        f"{sources[0].table.path}: {there}, none of which states what it holds, as 'time [s]' does:"
        f" {units}{use}"
    )


def _by_unit(source: _Source) -> str:
    unit = bare_unit(source.unit)
    if unit in SECONDS:
        return TIME
    heading = source.name.lower()
    words = set(re.findall("[a-z]+", heading))
    letter = AXIS.search(heading)
    lengths = next((name for name, known in WORDS.items() if known & words), "achieved")
    quantity = "drive" if unit in VOLTS else lengths
    return f"{quantity}_{letter[1] if letter else 'x'}"


def _values(sources: Sequence[_Source], columns: Sequence[Column]) -> dict[str, Array]:
    """Columns by name, in SI units, all of one length; raises InputError where one is not."""
    found = {column.name: _source(sources, column) for column in columns}
    factors = {column.name: _factor(column, found[column.name]) for column in columns}
    values: dict[str, Array] = {}
    for table in dict.fromkeys(source.table for source in found.values()):
        names = [name for name, source in found.items() if source.table is table]
        numbers = table.columns([found[name].index for name in names])
        values |= {name: factors[name] * n for name, n in zip(names, numbers, strict=True)}
    if len(set(map(len, values.values()))) > 1:
        counts = ", ".join(f"{name} {len(values[name])}" for name in found)
        raise InputError(
            f"{sources[0].table.path}: the columns differ in their number of rows: {counts}: give"
            " columns of one recording"
        )
    return {name: values[name] for name in found}


def _source(sources: Sequence[_Source], column: Column) -> _Source:
    found = [s for s in sources if column.place in {s.heading, s.name}]
    if column.place.isdecimal() and 1 <= int(column.place) <= len(sources):
        found = [sources[int(column.place) - 1]]
    if len(found) == 1:
        return found[0]
    where = f"{sources[0].table.path}: columns: {column.name} in column {column.place}"
    if found:
        raise InputError(f"{where}: {len(found)} columns have this name: give its number")
    names = ", ".join(s.heading for s in sources if s.heading)
    raise InputError(
        f"{where}: there are columns 1 to {len(sources)},"
        + (f" named {names}" if names else " and no heading names them: give a number")
    )


def _factor(column: Column, source: _Source) -> float:
    """Return the SI value of 1 in a column; raises InputError where it has no unit."""
    unit = column.unit or source.unit
    what = f"{source.table.path}: column '{source.heading or column.place}'"
    if not unit:
        raise InputError(f"{what}: has no unit: give it, as {column.name}={column.place}:UNIT")
    return factor_of(unit, _units_of(column.name), what)


MOVED = ("achieved", "desired")
"""Quantities whose motion shows whether a gap in time is one of the samples."""


@frozen(eq=False)
class TableRecord:
    """Signals by quantity and axis, (n,) in V or m, and a sentence on what their times are like."""

    sample_period: float
    signals: Mapping[str, Mapping[str, Array]] = field(repr=False)
    notes: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """Length of each signal."""
        return len(next(iter(next(iter(self.signals.values())).values())))

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes, in the order of the columns."""
        return tuple(next(iter(self.signals.values())))


def read_table_record(
    paths: Sequence[Path],
    columns: Sequence[Column] | None,
    rows: RowRange = EVERY,
    sample_rate: float | None = None,
    use: str = USE,
) -> TableRecord:
    """Read files joined column-wise, the columns numbered on from one to the next.

    Without ``columns`` the headings state what they hold, or their units do; a note then states
    which column was taken for what. The sample period comes from ``sample_rate`` (Hz) or from the
    column ``time``, which must be even. Raises InputError naming file, place and fix for whatever
    is wrong or missing; ``use`` shows how to name the columns.
    """
    sources = _sources([read_table(path, rows) for path in paths])
    chosen = columns or _named(sources)
    notes: tuple[str, ...] = ()
    if not chosen:
        chosen = _by_units(sources, use)
        taken = ", ".join(f"{column.name} from '{column.place}'" for column in chosen)
        notes = (f"{paths[0]}: columns are taken by their units: {taken}",)
    values = _values(sources, chosen)
    if (sample_rate is None) == (TIME not in values):
        raise InputError(
            f"{paths[0]}: give either a sample rate or a column 'time', in seconds since any moment"
        )
    signals = _paired(paths[0], values, use)
    if sample_rate:
        return TableRecord(1.0 / sample_rate, signals, notes)
    moved = [each for name in MOVED for each in signals.get(name, {}).values()]
    with naming(paths[0]):
        timing = timing_of(values[TIME], moved, first_row=rows.first)
    notes += (f"{paths[0]}: {timing.note}",) if timing.note else ()
    return TableRecord(timing.sample_period, signals, notes)


def _paired(path: Path, values: Mapping[str, Array], use: str) -> dict[str, dict[str, Array]]:
    """Return the values by quantity and axis.

    Raises InputError unless each quantity has a column for each axis that any has.
    """
    found: dict[str, dict[str, Array]] = {quantity: {} for quantity in QUANTITIES}
    for name, numbers in values.items():
        if form := FORM.fullmatch(name):
            found[form["quantity"]][form["axis"]] = numbers
    signals = {quantity: by_axis for quantity, by_axis in found.items() if by_axis}
    if not signals:
        raise InputError(f"{path}: no column is drive or displacement: {use}")
    for quantity, axis in product(signals, sorted({a for each in signals.values() for a in each})):
        if axis not in signals[quantity]:
            raise InputError(
                f"columns: no {quantity}_{axis}: name its column, or leave out all of axis {axis}"
            )
    return signals


BLOCK = 100_000
"""Rows that are held as text at once."""
EXACT = "%.17g"
"""Digits that give back every float."""


@frozen(eq=False)
class Signal:
    """Samples of one scan against time, shape (n,): ``name`` as ``desired_x``, in ``unit``."""

    name: str
    unit: str
    values: Array


def write_signals(path: Path, signals: Sequence[Signal]) -> None:
    """Write signals of one length as columns, with headings as ``drive_x [V]``."""
    rows = len(signals[0].values)
    with replacing(path) as beside, beside.open("w", encoding="utf-8") as file:
        file.write(",".join(f"{each.name} [{each.unit}]" for each in signals) + "\n")
        for first in range(0, rows, BLOCK):
            block = [each.values[first : first + BLOCK] for each in signals]
            np.savetxt(file, np.column_stack(block), fmt=EXACT, delimiter=",")
