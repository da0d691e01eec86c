"""What the columns of a table hold, as a person says it or as their headings do."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.tables import NumberTable
from afm_scan_ros.files.units import METRES, SECONDS, VOLTS, factor_of, name_and_unit

TIME = "time"
QUANTITIES = {"drive": VOLTS, "achieved": METRES, "desired": METRES}
"""Quantities that a column may hold of an axis, as ``drive_x``, and their units."""
FORM = re.compile(rf"(?P<quantity>{'|'.join(QUANTITIES)})_(?P<axis>[^\W_]+)")
USE = "name columns, as --columns time=1:s,drive_x=2:V,achieved_x=3:um"


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


@frozen(eq=False)
class Columns:
    """All columns of tables that stand side by side, numbered on from one to the next."""

    tables: Sequence[NumberTable]
    _sources: list[_Source] = field(init=False)

    @_sources.default
    def _sources_of_tables(self) -> list[_Source]:
        found = []
        for table in self.tables:
            names = table.names if len(table.names) == table.width else ("",) * table.width
            for index, heading in enumerate(names):
                found.append(_Source(table, index, heading, *name_and_unit(heading)))
        return found

    @property
    def path(self) -> Path:
        """Return the first file, for messages."""
        return self.tables[0].path

    def named(self) -> tuple[Column, ...]:
        """Return the columns whose headings are quantities with a unit, as ``drive_x [V]``.

        Raises InputError, which says how to name columns, where no heading is a quantity, or one
        that is has no unit.
        """
        known = [s for s in self._sources if s.name == TIME or FORM.fullmatch(s.name)]
        if not known:
            headings = ", ".join(s.heading for s in self._sources if s.heading)
            there = f"its headings are {headings}" if headings else "it has no headings"
            raise InputError(
                f"{self.path}: {there}, none of which says what it holds, as 'drive_x [V]': {USE}"
            )
        return tuple(Column(s.name, s.heading, "") for s in known)

    def values(self, column: Column) -> Array:
        """Numbers of a column in SI units, shape (rows,); raises InputError where there is none."""
        source = self._source(column)
        unit = column.unit or source.unit
        what = f"{source.table.path}: {column.name} in column '{column.place}'"
        if not unit:
            raise InputError(f"{what}: has no unit: give it, as {column.name}={column.place}:UNIT")
        return factor_of(unit, _units_of(column.name), what) * source.table.column(source.index)

    def _source(self, column: Column) -> _Source:
        found = [s for s in self._sources if column.place in {s.heading, s.name}]
        if column.place.isdecimal() and 1 <= int(column.place) <= len(self._sources):
            found = [self._sources[int(column.place) - 1]]
        if len(found) == 1:
            return found[0]
        where = f"{self.path}: columns: {column.name} in column {column.place}"
        if found:
            raise InputError(f"{where}: {len(found)} columns have this name: give its number")
        names = ", ".join(s.heading for s in self._sources if s.heading)
        raise InputError(
            f"{where}: there are columns 1 to {len(self._sources)},"
            + (f" named {names}" if names else " and no heading names them: give a number")
        )
