"""Tables of numbers in text: the separator, the decimal mark and the heading are found."""

import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from itertools import compress, islice
from pathlib import Path

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.units import is_unit

MOST_COLUMNS = 10_000
"""Columns of a table, many times a converter's channels: what has more is no record."""
LOOKED = 50
"""Lines of the later half that determine the separator and the columns, and first rows."""
CHANCE = 0.01
"""Share of whole files without an end of line that may be taken for files cut short."""
NUMBER = re.compile(
    r'\W*+(?P<whole>\d*)(?P<fraction>[.,]\d*)?(?:[eE][-+]?(?P<exponent>\d*))?["\s]*'
)
COMMENTS = ("#", "%")
SEPARATORS = (";", "\t", ",", None)
"""In the order in which they are preferred; None stands for blanks."""
FIX = (
    "correct the cell, or import the rows before and after it separately, with 'afm-scan import-csv"
    " --start-row --stop-row'"
)
CUT = "the file was cut short: remove the line"


@frozen
class RowRange:
    """Lines left out at the top, then the first and the last row taken, counted from 1."""

    skipped: int = 0
    first: int = 1
    last: int | None = None

    def of(self, path: Path, count: int) -> slice:
        """Return which of ``count`` rows are taken; raises InputError where less than two are."""
        last = count if self.last is None else self.last
        if count == 1:
            raise InputError(f"{path}: 1 row of numbers: give 2 at least")
        if not 1 <= self.first < last <= count:
            raise InputError(
                f"{path}: rows {self.first} to {last} of {count}: choose --start-row and --stop-row"
                " within them, with at least two rows"
            )
        return slice(self.first - 1, last)


EVERY = RowRange()


@frozen
class Dialect:
    """How rows are written: with another separator than a comma, numbers may have a decimal one."""

    separator: str | None

    def cells(self, line: str) -> list[str]:
        """Return what stands between the separators, without quotation marks.

        Of a line with more columns than a table may have, the last holds all that is over.
        """
        cells = line.split(self.separator, MOST_COLUMNS)
        return [cell.strip().strip('"').strip() for cell in cells]

    def with_points(self, line: str) -> str:
        """Return a row or a cell with decimal points."""
        return line if self.separator == "," else line.replace(",", ".")

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number, which may not be finite."""
        if "_" in cell or cell.endswith(","):
            return False
        try:
            float(self.with_points(cell))
        except ValueError:
            return False
        return True


@frozen(eq=False)
class TextTable:
    """Rows of a text file, and the line in which each of them stands.

    ``names`` are those of the columns, empty where the file gives none.
    """

    path: Path
    dialect: Dialect
    lines: NDArray[np.intp] = field(repr=False)
    rows: Sequence[str] = field(repr=False)
    names: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.dialect.cells(self.rows[0]))

    def columns(self, indices: Sequence[int]) -> Array:
        """Numbers of columns, shape (columns, rows); raises InputError naming line and column."""
        separator, rows = self.dialect.separator, self.rows
        if separator and any('"' in row for row in rows):  # numpy reads them next to separators
            rows = [re.sub(' +"', '"', row) for row in rows]
        numbers = np.empty((0, 0))
        with suppress(ValueError):
            numbers = np.loadtxt(
                rows if separator == "," else map(self.dialect.with_points, rows),
                delimiter=separator,
                usecols=indices,
                unpack=True,
                ndmin=2,
                comments=None,
                quotechar='"',
            )
        whole = numbers.shape[1] == len(rows) and np.isfinite(numbers).all()
        if not whole or (separator != "," and all(any(m in row for row in rows) for m in ",.")):
            for index in indices:
                self._refuse_wrong(index)
        if not whole:
            raise InputError(
                f"{self.path}: cannot be read as numbers: write them without quotation marks, and"
                " in the digits 0 to 9"
            )
        return numbers

    def place(self, row: int, index: int) -> str:
        """Name a cell by file, line and column, with what it holds."""
        cell = self.dialect.cells(self.rows[row])[index]
        return f"{self.path}: line {self.lines[row]}, column {index + 1}: '{cell}'"

    def _refuse_wrong(self, index: int) -> None:
        """Raise InputError for a cell that is no finite number, or has a mark for thousands."""
        cells = [self.dialect.cells(row)[index] for row in self.rows]
        points = any("." in cell for cell in cells)
        for row, cell in enumerate(cells):
            if not self.dialect.is_number(cell):
                raise InputError(f"{self.place(row, index)} is not a number: {FIX}")
            if not np.isfinite(float(self.dialect.with_points(cell))):
                raise InputError(f"{self.place(row, index)} is not finite: {FIX}")
            if points and "," in cell:
                raise InputError(
                    f"{self.place(row, index)} has a comma where other rows have a point: write"
                    " numbers with one decimal mark and without marks for thousands"
                )


def read_text(path: Path, taken: RowRange) -> TextTable:
    """Read a table whose heading is at the top, or in lines that begin with '#' or '%'.

    A line of units may follow that of the names. Raises InputError for what is not text, for
    ragged rows, and for a last row that was cut short.
    """
    lines = _text(path).replace("\r\n", "\n").split("\n")
    open_end = bool(lines[-1].strip())
    while lines and not lines[-1].strip():
        lines.pop()
    body = lines[taken.skipped :]
    kept = [not line.startswith(COMMENTS) for line in body]
    numbers, rows = taken.skipped + 1 + np.flatnonzero(kept), list(compress(body, kept))
    if not any(map(str.strip, rows)):
        after = f" after {taken.skipped} skipped lines" if taken.skipped else ""
        raise InputError(f"{path}: no rows{after}: give columns of drive and displacement")
    dialect, width, numeric = _sniffed(rows)
    if width > MOST_COLUMNS:
        raise InputError(f"{path}: over {MOST_COLUMNS} columns: give a table of a record")
    first = _first_row(TextTable(path, dialect, numbers, rows), width, numeric)
    heading = lines[: numbers[first] - 1]
    within = taken.of(path, len(rows) - first)
    numbers, rows = numbers[first:][within], rows[first:][within]
    if dialect.separator and all(row.endswith(dialect.separator) for row in rows):
        rows = [row[:-1] for row in rows]
    table = TextTable(path, dialect, numbers, rows)
    _refuse_ragged(table, open_end=open_end and numbers[-1] == len(lines))
    _refuse_second_heading(table)
    return evolve(table, names=_names(heading, dialect, table.width))


def _text(path: Path) -> str:
    """Return a file's text: UTF-8, UTF-16 with its mark, or one byte a character."""
    data = path.read_bytes()
    try:
        return data.decode("utf-16" if data[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig")
    except UnicodeDecodeError:
        if b"\0" in data:
            fix = "give text, .npy, .npz or .mat"
            raise InputError(f"{path}: neither text nor an array: {fix}") from None
        return data.decode("latin-1")


def _sniffed(rows: Sequence[str]) -> tuple[Dialect, int, list[int]]:
    """Return the dialect, the number of columns, and those that hold numbers in most lines.

    They are those of lines of the later half, which a heading hardly reaches. The separator is the
    one that makes most of the cells, and then most cells, numbers.
    """
    filled = [row for row in rows if row.strip()]
    later = filled[len(filled) // 2 :]
    sample = later[:: max(1, len(later) // LOOKED)]

    def merit(dialect: Dialect) -> tuple[float, int]:
        cells = [cell for line in sample for cell in dialect.cells(line)]
        numbers = sum(map(dialect.is_number, cells))
        return numbers / max(1, len(cells)), numbers

    there = (mark for mark in SEPARATORS if mark is None or any(mark in line for line in sample))
    dialect = max(map(Dialect, there), key=merit)
    split = [dialect.cells(line) for line in sample]
    width, _ = max(Counter(map(len, split)).items(), key=lambda item: (item[1], item[0]))
    columns = zip(*(cells for cells in split if len(cells) == width), strict=True)
    held = [[dialect.is_number(cell) for cell in column] for column in columns]
    return dialect, width, [k for k, each in enumerate(held) if 2 * sum(each) >= len(each)]


def _first_row(table: TextTable, width: int, numeric: Sequence[int]) -> int:
    """Return which line is the first row; raises InputError where a line above may be one too."""
    for k, row in enumerate(table.rows):
        cells = table.dialect.cells(row)
        whole = len(cells) == width
        good = [whole and table.dialect.is_number(cells[column]) for column in numeric]
        if numeric and all(good):
            return k
        if row.strip() and not whole and all(map(table.dialect.is_number, cells)):
            fix = f"give --skip-rows {table.lines[k]} where it is part of a heading"
            if '"' in row:
                fix = "write numbers without marks for thousands"
            raise InputError(
                f"{table.path}: line {table.lines[k]} has {len(cells)} columns, those below have"
                f" {width}: correct the line, or {fix}"
            )
        if any(good):
            raise InputError(
                f"{table.place(k, numeric[good.index(False)])} is not a number: correct the cell,"
                f" or give --skip-rows {table.lines[k]} where the line is a heading"
            )
    raise InputError(
        f"{table.path}: holds no rows of numbers: give columns of drive and displacement"
    )


def _refuse_ragged(table: TextTable, *, open_end: bool) -> None:
    """Raise InputError unless rows have as many columns; one that no line end follows is whole."""
    mark = table.dialect.separator
    counts = [row.count(mark) + 1 if mark else len(row.split()) for row in table.rows]
    last = f"{table.path}: line {table.lines[-1]} is the last and has no line end"
    wrong = next((k for k, count in enumerate(counts) if count != counts[0]), None)
    if wrong == len(counts) - 1 and open_end and counts[-1] < counts[0]:
        raise InputError(f"{last}: it has {counts[-1]} of {counts[0]} columns: {CUT}")
    if wrong is not None:
        count = counts[wrong] if table.rows[wrong].strip() else 0
        raise InputError(
            f"{table.path}: line {table.lines[wrong]} has {count} columns, line {table.lines[0]}"
            f" has {counts[0]}: correct the line, or leave a heading out with --skip-rows"
        )
    if open_end and _loses_digits([table.dialect.cells(row)[-1] for row in table.rows]):
        cell = table.dialect.cells(table.rows[-1])[-1]
        raise InputError(
            f"{last}: its '{cell}' has fewer digits than in every other row: {CUT}, or end it with"
            " a line end if it is whole"
        )


def _refuse_second_heading(table: TextTable) -> None:
    """Raise InputError for a row without numbers: those above it are another table's."""
    for number, row in zip(table.lines[:LOOKED], table.rows, strict=False):
        if not any(map(table.dialect.is_number, table.dialect.cells(row))):
            raise InputError(
                f"{table.path}: line {number} holds no number: correct it, or give --skip-rows"
                f" {number - 1} where it is the heading"
            )


def _loses_digits(cells: Sequence[str]) -> bool:
    """Whether the last of a column's cells has lost digits, of its mantissa or its exponent.

    It then ends a file whose writer was stopped. Many whole files have no end of line after their
    last row, and a number cut short is a number too. But a row is written as the others are. Its
    last number has fewer digits than in each of n other rows by chance in one of n + 1 files at
    most.
    """
    found = [match for match in map(NUMBER.fullmatch, cells) if match]
    mantissa = "fraction" if any(each["fraction"] for each in found) else "whole"
    scaled = [each for each in found if each["exponent"]]
    alike = scaled if found and found[-1]["exponent"] else found
    for part, of in ((mantissa, found), ("exponent", alike)):
        *others, last = [len(each[part] or "") for each in of] or [0]
        if len(others) + 1 >= 1.0 / CHANCE and last < min(others):
            return True
    return False


def _names(heading: Sequence[str], dialect: Dialect, width: int) -> tuple[str, ...]:
    """Return names of columns from the line nearest above the rows that has as many words.

    Where that is a line of units, these are put in brackets behind the names above it.
    """
    lines = (_words(line, dialect, width) for line in reversed(heading))
    nearest, *above = [*islice(filter(None, lines), 2)] or [()]
    units = [word.strip("[]()") for word in nearest]
    if not all(map(is_unit, units)):
        return nearest
    pairs = (pair for names in above for pair in zip(names, units, strict=True))
    return tuple(f"{name} [{unit}]" for name, unit in pairs)


def _words(line: str, dialect: Dialect, width: int) -> tuple[str, ...]:
    """Return the cells of a heading, empty where it has another number of them, or numbers."""
    text = line.lstrip("".join(COMMENTS)).strip(" \r")
    for mark in (dialect.separator, *SEPARATORS):
        cells = text.removesuffix(mark).split(mark) if mark else re.split(r"\s+(?![\[(])", text)
        words = tuple(cell.strip().strip('"').strip() for cell in cells)
        if len(words) == width and any(words) and not any(map(Dialect(mark).is_number, words)):
            return words
    return ()
