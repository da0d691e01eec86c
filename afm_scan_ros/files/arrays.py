"""Arrays in .npy, .npz and MATLAB files that need not be trusted."""

import hashlib
import io
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.unfolding import refuse_unfolding

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_HEADER = 2**16
"""Bytes within which the header of an .npy file ends; numpy itself parses 10,000 of them."""
_PIECE = 2**20
"""Bytes that are unfolded at once."""
_DIRECTORY = 2**20
"""Bytes that the directory of an archive may have: thousands of arrays."""


def read_numbers(stream: BinaryIO, size: int) -> Array:
    """Return the array of numbers in the ``size`` bytes of an .npy file.

    Raises ValueError where it is none, where it holds objects, which are never unpickled, and
    where it states another size than that of what follows.
    """
    begun = stream.read(min(size, _HEADER))
    head = io.BytesIO(begun)
    version = npy.read_magic(head)
    if version not in _HEADERS:
        raise ValueError(f"version {version} of the format is not supported")
    try:
        shape, fortran_order, kind = _HEADERS[version](head)
    except Exception as error:  # numpy raises errors of many kinds on a damaged header
        raise ValueError(f"its header cannot be read: {error}") from error
    if kind.hasobject:
        raise ValueError("holds objects, not numbers")
    stated, remaining = math.prod(shape) * kind.itemsize, size - head.tell()
    empty = kind.itemsize == 0 < math.prod(shape)
    if stated != remaining or empty or min(shape, default=0) < 0:
        raise ValueError(
            f"states {kind} of shape {shape}, {stated} bytes, where {remaining} follow"
        )
    held = np.empty(remaining, np.uint8)
    there = begun[head.tell() :]
    held[: len(there)] = np.frombuffer(there, np.uint8)
    _fill(held[len(there) :], stream)
    return held.view(kind).reshape(shape, order="F" if fortran_order else "C")


def _fill(held: NDArray[np.uint8], stream: BinaryIO) -> None:
    """Fill an array from a stream; raises EOFError where that ends before."""
    for first in range(0, held.size, _PIECE):
        piece = held[first : first + _PIECE]
        found = stream.read(piece.size)
        if len(found) != piece.size:
            raise EOFError(f"ends {held.size - first - len(found)} bytes before its end")
        piece[:] = np.frombuffer(found, np.uint8)


def read_npy(path: Path) -> Array:
    """Return the array of an .npy file; raises InputError where it holds none of numbers."""
    size = path.stat().st_size
    try:
        refuse_unfolding(size, size)
        with path.open("rb") as stream:
            return read_numbers(stream, size)
    except (ValueError, EOFError) as error:
        raise InputError(f"{path}: no array that numpy can read: {error}") from error


class _Wary(io.BufferedReader):
    """A file of which no more than ``most`` bytes are read at once, if that is not None."""

    most: int | None = _DIRECTORY

    def read(self, size: int | None = -1, /) -> bytes:
        """Return as many bytes; raises ValueError for more than ``most``."""
        if self.most is not None and size is not None and size > self.most:
            raise ValueError(f"its directory states {size} bytes, over {self.most}")
        return super().read(size)


@contextmanager
def open_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an .npz file whose arrays together unfold to what a recording can.

    Raises ValueError where they do not, and whatever else a damaged file makes zipfile run into.
    """
    with _Wary(io.FileIO(path)) as stream, zipfile.ZipFile(stream) as archive:
        stream.most = None
        for info in archive.infolist():
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"{info.filename} is not compressed as numpy does: save it anew")
        refuse_unfolding(sum(i.file_size for i in archive.infolist()), path.stat().st_size)
        yield archive


def read_member(archive: zipfile.ZipFile, name: str, most: float = math.inf) -> Array:
    """Return the array of an .npz file's member; raises what a damaged file makes it run into.

    Raises ValueError where it has more than ``most`` bytes.
    """
    info = archive.getinfo(name)
    if info.file_size > most:
        raise ValueError(f"{name} has {info.file_size} bytes, over {most}")
    with archive.open(info) as stream:
        values = read_numbers(cast("BinaryIO", stream), info.file_size)
        if stream.read(1):
            raise ValueError("holds more than it states")
    return values


LARGEST = 2**24  # bytes, a matrix of 1448 rows


class Archive:
    """The .npz file beside a model file; raises InputError for what cannot be trusted in it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read: set[str] = set()
        try:
            with open_archive(path) as archive:
                self._names = archive.namelist()
        except FileNotFoundError:
            raise InputError(f"{path}: no such file; put it beside the model file") from None
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{path}: not an .npz file: {error}") from error

    def matrix(self, name: str, *, square: bool = False) -> Array:
        """Matrix of that name, float64."""
        self._read.add(f"{name}.npy")
        if f"{name}.npy" not in self._names:
            raise InputError(f"{self._path}: no array '{name}' among {', '.join(self._names)}")
        values = self._array(name)
        expected = "square float64 matrix" if square else "float64 matrix"
        shaped = values.ndim == 2 and (not square or len(set(values.shape)) == 1)  # noqa: PLR2004
        if values.dtype != np.float64 or not shaped:
            found = f"{values.dtype} of shape {values.shape}"
            raise InputError(f"{self._path}: '{name}' should be a {expected}, not {found}")
        return values

    def refuse_others(self, sha256: str) -> None:
        """Raise InputError for another digest, unless it is empty, and for arrays not read."""
        if sha256 not in ("", self.sha256()):
            raise InputError(
                f"arrays_sha256 is not that of {self._path.name}, so these arrays are of another"
                " model: restore its own arrays, or delete arrays_sha256 if these are right"
            )
        unread = [name.removesuffix(".npy") for name in self._names if name not in self._read]
        if unread:
            raise InputError(
                f"{self._path.name} holds {', '.join(unread)}, which the file does not name: bring"
                " the whole file back, or take these arrays out"
            )

    def sha256(self) -> str:
        """Digest of the whole file, as ``sha256sum`` prints it."""
        with self._path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    def _array(self, name: str) -> Array:
        try:
            with open_archive(self._path) as archive:
                return read_member(archive, f"{name}.npy", LARGEST)
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{self._path}: array '{name}' is damaged: {error}") from error


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

    scipy trusts the tags of elements, and crashes. Source: The MathWorks, MAT-File Format,
    "Level 5 MAT-File Format".
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
