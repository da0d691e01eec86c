"""Tables of numbers in text: the separator, the decimal mark and the heading are found."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.units import is_unit

LEAST = 2
"""Rows of a table, at least."""
MOST_COLUMNS = 10_000
"""Columns of a table, many times a converter's channels: what has more is no record."""


@frozen
class RowRange:
    """Lines left out at the top, then the first and the last row taken, counted from 1."""

    skipped: int = 0
    first: int = 1
    last: int | None = None

    def of(self, path: Path, count: int) -> slice:
        """Return which of ``count`` rows are taken; raises InputError where less than two are."""
        last = count if self.last is None else self.last
        if count < LEAST:
            raise InputError(f"{path}: {count} row of numbers: give {LEAST} at least")
        if not 1 <= self.first < last <= count:
            raise InputError(
                f"{path}: rows {self.first} to {last} of {count}: choose --start-row and --stop-row"
                " within them, with at least two rows"
            )
        return slice(self.first - 1, last)


EVERY = RowRange()


CHANCE = 0.01
"""Share of whole files without an end of line that may be taken for files cut short."""
NUMBER = re.compile(
    r'\W*+(?P<whole>\d*)(?P<fraction>[.,]\d*)?(?:[eE][-+]?(?P<exponent>\d*))?["\s]*'
)


def ends_within(cells: Sequence[str]) -> bool:
    """Whether the last of a column's cells has lost digits, of its mantissa or its exponent.

    It then ends a file whose writer was stopped. Many whole files have no end of line after their
    last row, and a number cut short is a number too. But a row is written as the others are. Its
    last number has fewer digits than in each of n other rows by chance in one of n + 1 files at
    most.
    """
    found = [match for match in map(NUMBER.fullmatch, cells) if match]
    mantissa = "fraction" if any(each["fraction"] for each in found) else "whole"
    if _shortest(found, mantissa):
        return True
    scaled = [each for each in found if each["exponent"]]
    return _shortest(scaled if found and found[-1]["exponent"] else found, "exponent")


def _shortest(found: Sequence[re.Match[str]], part: str) -> bool:
    """Whether the last has less of a part than each of the others, which are enough to judge by."""
    *others, last = [len(each[part] or "") for each in found] or [0]
    return len(others) + 1 >= 1.0 / CHANCE and last < min(others)


COMMENTS = ("#", "%")
SEPARATORS = (";", "\t", ",", None)
"""In the order in which they are preferred; None stands for blanks."""
LOOKED = 50
"""Lines of the later half that determine the separator and the columns."""
FIX = "correct the cell, or leave its row out with 'afm-scan import-csv --start-row --stop-row'"
CUT = "the file was cut short: remove the line"


@frozen(eq=False)
class TextTable:
    """Rows of a text file, and the line in which each of them stands.

    ``names`` are those of the columns, empty where the file gives none. With another separator
    than a comma, numbers may have a decimal comma.
    """

    path: Path
    names: tuple[str, ...]
    separator: str | None
    lines: NDArray[np.intp] = field(repr=False)
    rows: Sequence[str] = field(repr=False)
    both_marks: bool = False

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(_cells(self.rows[0], self.separator))

    def column(self, index: int) -> Array:
        """Numbers of a column, shape (rows,); raises InputError naming line and column."""
        decimal_points = self.separator == ","
        rows = self.rows if decimal_points else (row.replace(",", ".") for row in self.rows)
        try:
            numbers = np.loadtxt(
                rows, delimiter=self.separator, usecols=index, comments=None, quotechar='"', ndmin=1
            )
        except ValueError:
            raise InputError(self._fault(index)) from None
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise InputError(f"{self._place(int(bad[0]), index)} is not finite: {FIX}")
        if self.both_marks:
            self._refuse_both_marks(index)
        return np.asarray(numbers, dtype=np.float64)

    def _cell(self, row: int, index: int) -> str:
        return _cells(self.rows[row], self.separator)[index]

    def _place(self, row: int, index: int) -> str:
        cell = self._cell(row, index)
        return f"{self.path}: line {self.lines[row]}, column {index + 1}: '{cell}'"

    def _fault(self, index: int) -> str:
        for row in range(len(self.rows)):
            if not _is_number(self._cell(row, index), self.separator):
                return f"{self._place(row, index)} is not a number: {FIX}"
        return f"{self.path}: column {index + 1} cannot be read as numbers: {FIX}"

    def _refuse_both_marks(self, index: int) -> None:
        """Raise InputError where some cells have a comma and some a point: one is for thousands."""
        cells = [_cells(row, self.separator)[index] for row in self.rows]
        comma = next((k for k, cell in enumerate(cells) if "," in cell), None)
        if comma is not None and any("." in cell for cell in cells):
            raise InputError(
                f"{self._place(comma, index)} has a comma where other rows have a point: write"
                " numbers with one decimal mark and without marks for thousands"
            )


def read_text(path: Path, taken: RowRange) -> TextTable:
    """Read a table whose heading is at the top, or in lines that begin with '#' or '%'.

    A line of units may follow that of the names. Raises InputError for what is not text, for
    ragged rows, and for a last row that was cut short.
    """
    text = _text(path).replace("\r\n", "\n")
    lines = text.rstrip().split("\n")
    kept = [k for k in range(taken.skipped, len(lines)) if not lines[k].startswith(COMMENTS)]
    filled = next((n for n, k in enumerate(kept) if lines[k].strip()), len(kept))
    places = np.array(kept[filled:], dtype=np.intp)
    if not places.size:
        after = f" after {taken.skipped} skipped lines" if taken.skipped else ""
        raise InputError(f"{path}: no rows{after}: give columns of drive and displacement")
    sample = _sample([lines[k] for k in places])
    separator = _separator(sample)
    width, numeric = _columns(sample, separator)
    if width > MOST_COLUMNS:
        raise InputError(f"{path}: {width} columns, over {MOST_COLUMNS}: give a table of a record")
    numbered = ((int(k) + 1, lines[k]) for k in places)
    places = places[_first_row(path, numbered, separator, width, numeric) :]
    heading = lines[: places[0]]
    places = places[taken.of(path, len(places))]
    numbers, rows = places + 1, tuple(lines[k] for k in places)
    if separator and all(row.endswith(separator) for row in rows):
        rows, width = tuple(row[:-1] for row in rows), width - 1
    open_end = numbers[-1] == len(lines) and not text[len(text.rstrip()) :].count("\n")
    _refuse_ragged(path, numbers, rows, separator, open_end=open_end)
    marks = "".join(rows) if separator != "," else ""
    both = "," in marks and "." in marks
    return TextTable(path, _names(heading, separator, width), separator, numbers, rows, both)


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


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def _plain(row: str, separator: str | None) -> str:
    """Return a row with decimal points."""
    return row if separator == "," else row.replace(",", ".")


def _is_number(cell: str, separator: str | None) -> bool:
    if "_" in cell or cell.endswith(","):
        return False
    try:
        float(_plain(cell, separator))
    except ValueError:
        return False
    return True


def _sample(lines: Sequence[str]) -> list[str]:
    """Lines of the later half, which a heading hardly reaches."""
    filled = [line for line in lines if line.strip()]
    later = filled[len(filled) // 2 :]
    return later[:: max(1, len(later) // LOOKED)]


def _separator(sample: Sequence[str]) -> str | None:
    """Return the separator that makes most of the cells, and then most cells, numbers."""

    def merit(separator: str | None) -> tuple[float, int]:
        cells = [cell for line in sample for cell in _cells(line, separator)]
        numbers = sum(_is_number(cell, separator) for cell in cells)
        return numbers / max(1, len(cells)), numbers

    there = [mark for mark in SEPARATORS if mark is None or any(mark in line for line in sample)]
    return max(there, key=merit)


def _columns(sample: Sequence[str], separator: str | None) -> tuple[int, list[int]]:
    """Return the number of columns, and those that hold numbers in most of the lines."""
    split = [_cells(line, separator) for line in sample]
    width, _ = max(Counter(map(len, split)).items(), key=lambda item: (item[1], item[0]))
    full = [cells for cells in split if len(cells) == width]
    held = [sum(_is_number(cells[k], separator) for cells in full) for k in range(width)]
    return width, [k for k, count in enumerate(held) if 2 * count >= len(full)]


def _first_row(
    path: Path,
    numbered: Iterable[tuple[int, str]],
    separator: str | None,
    width: int,
    numeric: Sequence[int],
) -> int:
    """Return which line is the first row; raises InputError where a line above may be one too."""
    for k, (number, line) in enumerate(numbered):
        cells = _cells(line, separator)
        whole = len(cells) == width
        good = [whole and _is_number(cells[column], separator) for column in numeric]
        if numeric and all(good):
            return k
        if line.strip() and not whole and all(_is_number(cell, separator) for cell in cells):
            raise InputError(
                f"{path}: line {number} has {len(cells)} columns, those below have {width}: correct"
                f" the line, or give --skip-rows {number} where it is part of a heading"
            )
        if any(good):
            column = numeric[good.index(False)]
            raise InputError(
                f"{path}: line {number}, column {column + 1}: '{cells[column]}' is not a number:"
                f" correct the cell, or give --skip-rows {number} where the line is a heading"
            )
    raise InputError(f"{path}: holds no rows of numbers: give columns of drive and displacement")


def _refuse_ragged(
    path: Path,
    numbers: NDArray[np.intp],
    rows: Sequence[str],
    separator: str | None,
    *,
    open_end: bool,
) -> None:
    """Raise InputError unless rows have as many columns; one that no line end follows is whole."""
    counts = [row.count(separator) + 1 if separator else len(row.split()) for row in rows]
    last = f"{path}: line {numbers[-1]} is the last and has no line end"
    for number, row, count in zip(numbers, rows, counts, strict=True):
        if count < counts[0] and open_end and number == numbers[-1]:
            raise InputError(f"{last}: it has {count} of {counts[0]} columns: {CUT}")
        if count != counts[0] or not row.strip():
            raise InputError(
                f"{path}: line {number} has {count if row.strip() else 0} columns, line"
                f" {numbers[0]} has {counts[0]}: correct the line, or leave a heading out with"
                " --skip-rows"
            )
    if open_end and ends_within([_cells(row, separator)[-1] for row in rows]):
        cell = _cells(rows[-1], separator)[-1]
        raise InputError(
            f"{last}: its '{cell}' has fewer digits than in every other row: {CUT}, or end it with"
            " a line end if it is whole"
        )


def _names(heading: Sequence[str], separator: str | None, width: int) -> tuple[str, ...]:
    """Return names of columns from the line nearest above the rows that has as many words.

    Where that is a line of units, these are put in brackets behind the names above it.
    """
    units: tuple[str, ...] = ()
    for line in reversed(heading):
        found = _words(line.lstrip("".join(COMMENTS)).strip(" \r"), separator, width)
        if not found:
            continue
        if not units and all(is_unit(word.strip("[]()")) for word in found):
            units = found
            continue
        if units:
            pairs = zip(found, units, strict=True)
            return tuple(f"{name} [{unit.strip('[]()')}]" for name, unit in pairs)
        return found
    return ()


def _words(line: str, separator: str | None, width: int) -> tuple[str, ...]:
    """Return the cells of a heading, empty where it has another number of them, or numbers."""
    for mark in (separator, *SEPARATORS):
        if mark is None:
            cells = re.split(r"\s+(?![\[(])", line)
        else:
            cells = line.removesuffix(mark).split(mark)
        words = tuple(cell.strip().strip('"').strip() for cell in cells)
        numbers = any(_is_number(word, mark) for word in words)
        if len(words) == width and any(words) and not numbers:
            return words
    return ()
