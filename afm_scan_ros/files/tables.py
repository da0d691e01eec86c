"""Tables of numbers that no ROS recorded: text, and arrays of numpy and MATLAB.

The elements of a MATLAB file are checked before scipy reads them, which trusts what they state.
"""

import math
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from attrs import evolve, field, frozen
from scipy.io import loadmat
from scipy.io.matlab import matfile_version

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.arrays import open_archive, read_member, read_npy, refuse_unfolding
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


HEADER = 128
"""Bytes of text, version and byte order before the first element."""
TAG = 8
"""Bytes of a tag: type and size of an element."""
MATRIX, COMPRESSED = 14, 15
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
"""Types of elements that hold numbers or characters."""
FLAGS, COMPLEX = 6, 0x800
"""Type of the array flags, and the bit among them by which an imaginary part follows."""
SPARSE, DATA = 5, range(1, 16)
"""Class of a sparse matrix, which states more elements than it holds, and classes of all data."""
PARTS = {4: 4, 5: 6} | dict.fromkeys(range(6, 16), 4)
"""Elements of a matrix by its class: characters, sparse, and numbers; an imaginary part is more."""
CHARACTERS, HOLDERS = 4, range(1, 4)
"""Class of text, and those whose elements are matrices: cells, structures and objects."""
LONGEST = 2**24
"""Characters of a text, each of which takes many bytes in memory."""
MOST_ELEMENTS = 10**6
"""Elements of a file, each of which takes hundreds of bytes in memory."""


def check_elements(path: Path) -> None:
    """Raise ValueError where an element of a level 5 file has no known type or does not fit.

    Source: The MathWorks, MAT-File Format, "Level 5 MAT-File Format".
    """
    content = path.read_bytes()
    order = "<" if content[126:HEADER] == b"IM" else ">"
    found = list(_elements(memoryview(content)[HEADER:], order, padded=False))
    refuse_unfolding(sum(_unfolded(*each, order) for each in found), len(content))
    left = MOST_ELEMENTS
    for kind, data in found:
        inner = [(kind, data)]
        if kind == COMPRESSED:
            inner = list(_elements(_inflated(data, order), order, padded=False))
        for each, matrix in inner:
            if each != MATRIX:
                raise ValueError(f"an element of type {each} stands where an array should")
            left = _check_matrix(matrix, order, left)


def _unfolded(kind: int, data: memoryview, order: str) -> int:
    """Return the bytes that an element states to hold once it is not compressed."""
    if kind != COMPRESSED:
        return len(data)
    tag = zlib.decompressobj().decompress(data, TAG)
    if len(tag) < TAG:
        raise ValueError("a compressed element has no tag")
    return TAG + int(struct.unpack_from(f"{order}I", tag, 4)[0])


def _inflated(data: memoryview, order: str) -> memoryview:
    """Return what a compressed element holds, which must be as long as it states."""
    size, inflating = _unfolded(COMPRESSED, data, order), zlib.decompressobj()
    held = inflating.decompress(data, size + 1)
    if len(held) > size or not inflating.eof:
        raise ValueError(f"a compressed element holds more than the {size} bytes that it states")
    return memoryview(held)


def _check_matrix(data: memoryview, order: str, left: int) -> int:
    """Check the elements of a matrix and of those in it; an empty one has none.

    Returns how many elements are ``left`` of those that the file may have.
    """
    parts = list(islice(_elements(data, order, padded=True), left + 1))
    left -= len(parts)
    if left < 0:
        raise ValueError(f"its arrays have more than {MOST_ELEMENTS} elements")
    if not parts:
        return left
    (kind, flags), *_ = parts
    if kind != FLAGS or len(flags) != 8:  # noqa: PLR2004 - two numbers of 4 bytes
        raise ValueError("an array begins without its flags")
    (word,) = struct.unpack_from(f"{order}I", flags)
    number = word & 0xFF
    if number in DATA and number != SPARSE and len(parts) > 1:
        held = len(parts) if number in HOLDERS else len(data)
        _check_size(parts[1][1], min(held, LONGEST) if number == CHARACTERS else held, order)
    needed = PARTS.get(number)
    if needed is not None and len(parts) != needed + bool(word & COMPLEX):
        raise ValueError(f"an array of class {number} has {len(parts)} elements")
    for kind, inner in parts:
        if kind == MATRIX and needed is None:
            left = _check_matrix(inner, order, left)
        elif kind not in NUMBERS:
            raise ValueError(f"an array holds an element of unknown type {kind}")
    return left


def _check_size(sizes: memoryview, held: int, order: str) -> None:
    """Check an array's sizes: scipy takes memory for what is stated, a byte or more an element."""
    stated = math.prod(struct.unpack(f"{order}{len(sizes) // 4}i", sizes[: len(sizes) // 4 * 4]))
    if not 0 <= stated <= held:
        raise ValueError(f"an array states {stated} elements, more than it holds")


def _elements(data: memoryview, order: str, *, padded: bool) -> Iterator[tuple[int, memoryview]]:
    """Yield type and data of each element; ``padded`` ones begin at multiples of 8 bytes."""
    at = 0
    while at < len(data):
        if len(data) - at < TAG:
            raise ValueError(f"ends within a tag, after {len(data) - at} bytes of it")
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start, after = at + 8, at + 8 + size
        if kind >> 16:  # a small element: size, type and up to 4 bytes of data in place of a tag
            kind, size = kind & 0xFFFF, kind >> 16
            start, after = at + 4, at + 8
        if start + size > min(after, len(data)):
            raise ValueError(f"an element states {size} bytes, more than follow")
        yield kind, data[start : start + size]
        at = after + (-size % 8 if padded and start == at + 8 else 0)
