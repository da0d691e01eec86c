"""Numbers in a text file, whatever separates them."""

from pathlib import Path

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

COMMENT = "#"
SEPARATORS = (";", ",")


@frozen(eq=False)
class TextTable:
    """Cells of a text file, and the line in which each row stands."""

    path: Path
    heading: tuple[str, ...]
    lines: tuple[int, ...] = field(repr=False)
    rows: tuple[list[str], ...] = field(repr=False)

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.rows[0])

    def column(self, index: int) -> Array:
        """Numbers of a column, shape (rows,); raises InputError naming line and column."""
        numbers = np.empty(len(self.rows))
        for k, row in enumerate(self.rows):
            try:
                numbers[k] = float(row[index])
            except ValueError:
                raise InputError(self._fault(k, index, "not a number")) from None
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise InputError(self._fault(int(bad[0]), index, "not finite"))
        return numbers

    def _fault(self, row: int, index: int, fault: str) -> str:
        cell = self.rows[row][index]
        mend = "mend the cell, or leave its row out with --start-row and --stop-row"
        if "," in cell:
            mend = "write numbers with a decimal point"
        elif row == 0:
            mend = "leave a heading out with --skip-rows"
        return (
            f"{self.path}: line {self.lines[row]}, column {index + 1}: '{cell}' is {fault}: {mend}"
        )


def read_text(path: Path, skipped: int) -> TextTable:
    """Read the cells between semicolons, else commas, else blanks, as the first row has them.

    The last of the ``skipped`` lines names the columns. Lines that begin with '#', and blank
    ones at the end, are no rows. Raises InputError for what is not text, and for ragged rows.
    """
    try:
        text = path.read_text("utf-8-sig").rstrip()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: neither text nor a .npy array: export it as text") from error
    lines = text.split("\n")
    numbered = [
        (number, line)
        for number, line in enumerate(lines[skipped:], start=skipped + 1)
        if text and not line.startswith(COMMENT)
    ]
    if not numbered:
        raise InputError(f"{path}: holds no rows after {skipped} skipped lines")
    separator = next((mark for mark in SEPARATORS if mark in numbered[0][1]), None)
    rows = tuple(_cells(line, separator) for _, line in numbered)
    numbers = tuple(number for number, _ in numbered)
    _refuse_ragged(path, numbers, rows)
    heading = _cells(lines[skipped - 1].lstrip(COMMENT), separator) if skipped else []
    return TextTable(path, tuple(heading), numbers, rows)


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip() for cell in line.split(separator)]


def _refuse_ragged(path: Path, lines: tuple[int, ...], rows: tuple[list[str], ...]) -> None:
    for line, row in zip(lines, rows, strict=True):
        if len(row) != len(rows[0]):
            raise InputError(
                f"{path}: line {line} has {len(row)} columns, line {lines[0]} has {len(rows[0])}:"
                " mend the line, or leave a heading out with --skip-rows"
            )
