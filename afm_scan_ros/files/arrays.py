"""Arrays in .npy, .npz and MATLAB files that need not be trusted."""

import hashlib
import io
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_numbers(stream: BinaryIO, size: int) -> Array:
    """Return the array of numbers in the ``size`` bytes of an .npy file.

    Raises ValueError where it is none, where it holds objects, which are never unpickled, and
    where it states another size than that of what follows.
    """
    version = npy.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"version {version} of the format is not supported")
    try:
        shape, _, kind = _HEADERS[version](stream)
    except Exception as error:  # numpy raises errors of many kinds on a damaged header
        raise ValueError(f"its header cannot be read: {error}") from error
    if kind.hasobject:
        raise ValueError("holds objects, not numbers")
    stated, remaining = math.prod(shape) * kind.itemsize, size - stream.tell()
    if stated != remaining or min(shape, default=0) < 0:
        raise ValueError(
            f"states {kind} of shape {shape}, {stated} bytes, where {remaining} follow"
        )
    stream.seek(0)
    values: Array = npy.read_array(stream, allow_pickle=False)
    return values


def read_npy(path: Path) -> Array:
    """Return the array of an .npy file; raises InputError where it holds none of numbers."""
    try:
        with path.open("rb") as stream:
            return read_numbers(stream, path.stat().st_size)
    except (ValueError, EOFError) as error:
        raise InputError(f"{path}: no array that numpy can read: {error}") from error


def read_member(archive: zipfile.ZipFile, name: str) -> Array:
    """Return the array of an .npz file's member; raises what a damaged file makes it run into."""
    content = archive.read(name)
    return read_numbers(io.BytesIO(content), len(content))


LARGEST = 2**24  # bytes, a matrix of 1448 rows


class Archive:
    """The .npz file beside a model file; raises InputError for what cannot be trusted in it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read: set[str] = set()
        try:
            with zipfile.ZipFile(path) as archive:
                self._sizes = {info.filename: info.file_size for info in archive.infolist()}
        except FileNotFoundError:
            raise InputError(f"{path}: no such file; put it beside the model file") from None
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{path}: not an .npz file: {error}") from error

    def matrix(self, name: str, *, square: bool = False) -> Array:
        """Matrix of that name, float64."""
        self._read.add(f"{name}.npy")
        size = self._sizes.get(f"{name}.npy")
        if size is None:
            raise InputError(f"{self._path}: no array '{name}' among {', '.join(self._sizes)}")
        if size > LARGEST:
            raise InputError(f"{self._path}: '{name}' has {size} bytes, over {LARGEST}")
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
        unread = [name.removesuffix(".npy") for name in self._sizes if name not in self._read]
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
            with zipfile.ZipFile(self._path) as archive:
                return read_member(archive, f"{name}.npy")
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{self._path}: array '{name}' is damaged: {error}") from error


HEADER = 128
"""Bytes of text, version and byte order before the first element."""
MATRIX, COMPRESSED = 14, 15
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
"""Types of elements that hold numbers or characters."""
FLAGS, COMPLEX = 6, 0x800
"""Type of the array flags, and the bit among them by which an imaginary part follows."""
SPARSE, DATA = 5, range(1, 16)
"""Class of a sparse matrix, which states more elements than it holds, and classes of all data."""
PARTS = {4: 4, 5: 6} | dict.fromkeys(range(6, 16), 4)
"""Elements of a matrix by its class: characters, sparse, and numbers; an imaginary part is more."""


def check_elements(path: Path) -> None:
    """Raise ValueError where an element of a level 5 file has no known type or does not fit.

    scipy trusts the tags of elements, and crashes. Source: The MathWorks, MAT-File Format,
    "Level 5 MAT-File Format".
    """
    content = path.read_bytes()
    order = "<" if content[126:HEADER] == b"IM" else ">"
    for kind, data in _elements(memoryview(content)[HEADER:], order, padded=False):
        found = [(kind, data)]
        if kind == COMPRESSED:
            found = list(_elements(memoryview(zlib.decompress(data)), order, padded=False))
        for each, matrix in found:
            if each != MATRIX:
                raise ValueError(f"an element of type {each} stands where an array should")
            _check_matrix(matrix, order)


def _check_matrix(data: memoryview, order: str) -> None:
    """Check the elements of a matrix and of those in it; an empty one has none."""
    parts = list(_elements(data, order, padded=True))
    if not parts:
        return
    (kind, flags), *_ = parts
    if kind != FLAGS or len(flags) != 8:  # noqa: PLR2004 - two numbers of 4 bytes
        raise ValueError("an array begins without its flags")
    (word,) = struct.unpack_from(f"{order}I", flags)
    if word & 0xFF in DATA and word & 0xFF != SPARSE and len(parts) > 1:
        _check_size(parts[1][1], len(data), order)
    needed = PARTS.get(word & 0xFF)
    if needed is not None and len(parts) != needed + bool(word & COMPLEX):
        raise ValueError(f"an array of class {word & 0xFF} has {len(parts)} elements")
    for kind, inner in parts:
        if kind == MATRIX and needed is None:
            _check_matrix(inner, order)
        elif kind not in NUMBERS:
            raise ValueError(f"an array holds an element of unknown type {kind}")


def _check_size(sizes: memoryview, held: int, order: str) -> None:
    """Check an array's sizes: scipy takes memory for what is stated, a byte or more an element."""
    stated = math.prod(struct.unpack(f"{order}{len(sizes) // 4}i", sizes[: len(sizes) // 4 * 4]))
    if not 0 <= stated <= held:
        raise ValueError(f"an array states {stated} elements, more than it holds")


def _elements(data: memoryview, order: str, *, padded: bool) -> Iterator[tuple[int, memoryview]]:
    """Yield type and data of each element; ``padded`` ones begin at multiples of 8 bytes."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:  # noqa: PLR2004 - a tag's bytes
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
