"""Tables of numbers in files that no ROS recorded: text, and numpy arrays."""

from pathlib import Path
from typing import Protocol

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import check_header

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
        fix = "correct the cell, or exclude its row with --start-row and --stop-row"
        if "," in cell:
            fix = "write numbers with a decimal point"
        elif row == 0:
            fix = "skip a heading with --skip-rows"
        return (
            f"{self.path}: line {self.lines[row]}, column {index + 1}: '{cell}' is {fault}: {fix}"
        )


def read_text(path: Path, skipped: int) -> TextTable:
    """Read the cells between semicolons, else commas, else blanks, as the first row has them.

    The last of the ``skipped`` lines names the columns. Lines that begin with '#', and blank
    ones at the end, are no rows. Raises InputError for what is not text, and for ragged rows.
    """
    try:
        text = path.read_text("utf-8-sig").rstrip()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: neither text nor an .npy array: export it as text") from error
    lines = text.split("\n")
    numbered = [
        (number, line)
        for number, line in enumerate(lines[skipped:], start=skipped + 1)
        if text and not line.startswith(COMMENT)
    ]
    if not numbered:
        raise InputError(f"{path}: no rows after {skipped} skipped lines")
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
                " correct the line, or skip a heading with --skip-rows"
            )


@frozen(eq=False)
class ArrayTable:
    """Rows along an array's first axis; its other axes make columns, the last one running first."""

    path: Path
    cells: Array = field(repr=False)

    @property
    def heading(self) -> tuple[str, ...]:
        """No names: an array has none."""
        return ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.cells.shape[1])

    def column(self, index: int) -> Array:
        """Numbers of a column, shape (rows,); raises InputError naming a row that is not finite."""
        numbers = self.cells[:, index]
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise InputError(
                f"{self.path}: row {bad[0] + 1}, column {index + 1}: {numbers[bad[0]]} is not"
                " finite: choose rows with --start-row and --stop-row"
            )
        return numbers


def read_array(path: Path) -> ArrayTable:
    """Read an array of real numbers; raises InputError where the file holds no such thing."""
    try:
        with path.open("rb") as stream:
            check_header(stream, path.stat().st_size)
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise InputError(f"{path}: no array that numpy can read: {error}") from error
    real = np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)
    if not real or array.size == 0 or array.ndim == 0:
        raise InputError(
            f"{path}: holds {array.dtype} of shape {array.shape}: give real numbers, the samples"
            " along the first axis"
        )
    return ArrayTable(path, np.asarray(array.reshape(len(array), -1), dtype=np.float64))


class NumberTable(Protocol):
    """Columns of one length; counted from 0 here, from 1 by people and in messages."""

    @property
    def heading(self) -> tuple[str, ...]:
        """Names of the columns, empty where the file gives none."""
        ...

    @property
    def width(self) -> int:
        """Number of columns."""
        ...

    def column(self, index: int) -> Array:
        """Numbers of a column, shape (rows,); raises InputError naming the cell that is none."""
        ...


def read_table(path: Path, skipped: int = 0) -> NumberTable:
    """Read a ``.npy`` array, or a text file without its first ``skipped`` lines.

    Raises InputError where it is neither, holds no rows, or has ragged ones.
    """
    if path.suffix != ".npy":
        return read_text(path, skipped)
    if skipped:
        raise InputError(f"{path}: an array has no lines to skip: omit --skip-rows")
    return read_array(path)
