"""Tables of numbers that no ROS recorded: text, and arrays of numpy and MATLAB."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from attrs import evolve, field, frozen
from scipy.io import loadmat
from scipy.io.matlab import matfile_version

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import open_archive, read_member, read_npy
from afm_scan_ros.files.matlab import check_elements
from afm_scan_ros.files.text_table import EVERY, MOST_COLUMNS, RowRange, TextTable, read_text

LEVEL_5 = 1
"""Major version of MATLAB's files since its version 5, except for 7.3."""
GIVE = (
    f"give real numbers, the samples along the first axis and at most {MOST_COLUMNS} others beside"
)


@frozen(eq=False)
class ArrayTable:
    """Columns of the arrays of a file.

    An array's rows are samples; its other axes make columns, the last one running first. ``names``
    are those of the arrays, as ``u``, with the number of the column where there are several, as
    ``u[2]``; an ``.npy`` file has none.
    """

    path: Path
    names: tuple[str, ...]
    cells: tuple[Array, ...] = field(repr=False)
    rows: RowRange = EVERY

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.cells)

    def columns(self, indices: Sequence[int]) -> list[Array]:
        """Numbers of columns, shape (rows,); raises InputError naming a row that is not finite."""
        return [self._column(index) for index in indices]

    def _column(self, index: int) -> Array:
        cells = self.cells[index]
        taken = cells[self.rows.of(self.path, len(cells))]
        numbers = np.asarray(taken, dtype=np.float64)
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            row, number = bad[0] + self.rows.first, numbers[bad[0]]
            raise InputError(
                f"{self.path}: row {row}, column {index + 1}: {number} is not finite: choose rows"
                " with 'afm-scan import-csv --start-row --stop-row'"
            )
        return numbers


NumberTable: TypeAlias = ArrayTable | TextTable
"""Columns, counted from 0 here, and from 1 by people and in messages."""


def read_table(path: Path, rows: RowRange = EVERY) -> NumberTable:
    """Read rows of a file of arrays or of a text file.

    Raises InputError where it is neither, holds no rows, or has ragged ones.
    """
    if not path.is_file():
        raise InputError(f"{path}: is no file: give a table of text, .npy, .npz or .mat")
    read = {".npy": read_array, ".npz": read_archive, ".mat": read_matlab}.get(path.suffix.lower())
    if read is None:
        return read_text(path, rows)
    if rows.skipped:
        raise InputError(f"{path}: an array has no lines to skip: omit --skip-rows")
    return evolve(read(path), rows=rows)


def read_array(path: Path) -> ArrayTable:
    """Read an ``.npy`` file; raises InputError where it holds no array of real numbers."""
    array = read_npy(path)
    if not _real(array) or array.size > MOST_COLUMNS * len(array):
        raise InputError(f"{path}: holds {array.dtype} of shape {array.shape}: {GIVE}")
    return ArrayTable(path, (), tuple(array.reshape(len(array), -1).T))


def read_archive(path: Path) -> ArrayTable:
    """Read the arrays of real numbers in an ``.npz`` file; raises InputError where none is."""
    try:
        with open_archive(path) as archive:
            names = archive.namelist()
            arrays = {name.removesuffix(".npy"): read_member(archive, name) for name in names}
    except Exception as error:  # zipfile raises whatever a damaged file makes it run into
        raise InputError(f"{path}: no archive that numpy can read: {error}") from error
    return _table(path, arrays)


def read_matlab(path: Path) -> ArrayTable:
    """Read the arrays of real numbers in a MATLAB file, also those in its structures.

    Raises InputError where there is none, and for a file of version 7.3.
    """
    try:
        if matfile_version(path)[0] == LEVEL_5:
            check_elements(path)
        arrays = dict(_fields("", loadmat(path)))
    except NotImplementedError:
        fix = f"save it in MATLAB with save('{path.name}', ..., '-v7')"
        raise InputError(f"{path}: is a MATLAB file of version 7.3: {fix}") from None
    except Exception as error:  # scipy raises whatever a damaged file makes it run into
        raise InputError(f"{path}: no MATLAB file that scipy can read: {error}") from error
    return _table(path, arrays)


def _fields(prefix: str, values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield arrays by name, those of a structure ``s`` as ``s.name``."""
    for name, value in values.items():
        kind = getattr(value, "dtype", None)
        if kind is not None and kind.names and value.size == 1:
            record = value.reshape(-1)[0]
            yield from _fields(f"{prefix}{name}.", {each: record[each] for each in kind.names})
        elif not name.startswith("__"):
            yield f"{prefix}{name}", value


def _real(array: object) -> bool:
    return (
        isinstance(array, np.ndarray) and array.dtype.kind in "iuf" and array.size > 0 < array.ndim
    )


def _table(path: Path, arrays: Mapping[str, Any]) -> ArrayTable:
    """Return the columns of all arrays that are longer than one sample; a row is one column."""
    columns: dict[str, Array] = {}
    for name, array in arrays.items():
        if not _real(array) or array.size == 1:
            continue
        samples = array.T if array.ndim == 2 and len(array) == 1 else array  # noqa: PLR2004 - a row
        if array.size > MOST_COLUMNS * len(samples):
            continue
        flat = samples.reshape(len(samples), -1).T
        numbered = len(flat) > 1
        columns |= {f"{name}[{k}]" if numbered else name: c for k, c in enumerate(flat, start=1)}
    if not columns:
        held = ", ".join(arrays) or "nothing"
        raise InputError(f"{path}: holds {held}: {GIVE}")
    return ArrayTable(path, tuple(columns), tuple(columns.values()))
