"""Columns of tables to a recording in SI units, sampled evenly."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.timing import timing_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.columns import FORM, QUANTITIES, TIME, USE, Column, Columns
from afm_scan_ros.files.records import naming
from afm_scan_ros.files.rows import Rows
from afm_scan_ros.files.tables import read_table

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
    paths: Sequence[Path], columns: Sequence[Column] | None, rows: Rows, sample_rate: float | None
) -> TableRecord:
    """Read files joined column-wise, the columns numbered on from one to the next.

    Without ``columns`` the headings state what they hold, or their units do; a note then states
    which column was taken for what. The sample period comes from ``sample_rate`` (Hz) or from the
    column ``time``, which must be even. Raises InputError naming file, place and fix for whatever
    is wrong or missing.
    """
    tables = Columns([read_table(path, rows) for path in paths])
    chosen = columns or tables.named()
    notes: tuple[str, ...] = ()
    if not chosen:
        chosen = tables.by_units()
        taken = ", ".join(f"{column.name} from '{column.place}'" for column in chosen)
        notes = (f"{tables.path}: columns are taken by their units: {taken}",)
    names = [column.name for column in chosen]
    if (sample_rate is None) == (TIME not in names):
        raise InputError(
            f"{tables.path}: give either a sample rate or a column 'time', for when samples were"
            " taken"
        )
    _refuse_unpaired(tables.path, names)
    values = _values(tables, chosen)
    signals: dict[str, dict[str, Array]] = {}
    for name, numbers in values.items():
        if form := FORM.fullmatch(name):
            signals.setdefault(form["quantity"], {})[form["axis"]] = numbers
    signals = {quantity: signals[quantity] for quantity in QUANTITIES if quantity in signals}
    if sample_rate:
        return TableRecord(1.0 / sample_rate, signals, notes)
    moved = [each for name in MOVED for each in signals.get(name, {}).values()]
    with naming(tables.path):
        timing = timing_of(values[TIME], moved, first_row=rows.first)
    notes += (f"{tables.path}: {timing.note}",) if timing.note else ()
    return TableRecord(timing.sample_period, signals, notes)


def _refuse_unpaired(path: Path, names: Sequence[str]) -> None:
    """Raise InputError unless each quantity has a column for each axis that any has."""
    forms = [form for form in map(FORM.fullmatch, names) if form]
    if not forms:
        raise InputError(f"{path}: no column is drive or displacement: {USE}")
    for quantity in dict.fromkeys(form["quantity"] for form in forms):
        for axis in dict.fromkeys(form["axis"] for form in forms):
            if f"{quantity}_{axis}" not in names:
                raise InputError(
                    f"columns: no {quantity}_{axis}: name its column, or leave out all of axis"
                    f" {axis}"
                )


def _values(tables: Columns, columns: Sequence[Column]) -> dict[str, Array]:
    """Columns by name, in SI units, all of one length."""
    values = {column.name: tables.values(column) for column in columns}
    lengths = {name: len(numbers) for name, numbers in values.items()}
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(
            f"{tables.path}: the columns differ in their number of rows: {counts}: give columns of"
            " one recording"
        )
    return values
