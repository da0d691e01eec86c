"""Arrays in .npy and .npz files that need not be trusted, and how much any file may unfold to.

A model file and the arrays beside it are a pair at any moment, whoever is killed: the model file
states the digest of both. Arrays that are new lie beside it by their digest until the model file
that states it is there. Then they take the place of those before.
"""

import hashlib
import io
import json
import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import yaml
from afm_scan_ros.files.paths import flush, writing

FREE = 2**28
"""Bytes that any file may unfold to, however small it is: a drive at rest folds to nothing."""
MOST_TIMES = 64
"""Times its own size that a larger file may unfold to.

A number has 64 bits at most, and a sensor's one bit of noise at least, which no compression
leaves out. What folds further holds no recording.
"""


def refuse_unfolding(unfolded: int, folded: int) -> None:
    """Raise ValueError where so many bytes are no recording, or more than the computer's memory.

    ``unfolded`` is what a file states of ``folded`` bytes.
    """
    if unfolded > max(FREE, MOST_TIMES * folded):
        raise ValueError(
            f"{folded} bytes unfold to {unfolded}, over {MOST_TIMES} times as many, as no recording"
            " does: save it without compression"
        )
    if unfolded > (there := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")):
        raise ValueError(
            f"unfolds to {unfolded} bytes, and this computer's memory has {there}: give a part"
        )


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
        raise ValueError(f"'{name.removesuffix('.npy')}' has {info.file_size} bytes, over {most}")
    with archive.open(info) as stream:
        values = read_numbers(cast("BinaryIO", stream), info.file_size)
        if stream.read(1):
            raise ValueError("holds more than it states")
    return values


LARGEST = 2**24  # bytes, a matrix of 1448 rows


def sha256_of(path: Path) -> str:
    """Digest of a file, as ``sha256sum`` prints it."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


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
        if sha256 not in ("", sha256_of(self._path)):
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

    def _array(self, name: str) -> Array:
        try:
            with open_archive(self._path) as archive:
                return read_member(archive, f"{name}.npy", LARGEST)
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{self._path}: array '{name}' is damaged: {error}") from error


SEAL = "content_sha256"
"""Key of the digest of all other keys and values of the model file."""


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a model file's content with its digest, which shows whether it is whole later."""
    return {SEAL: _digest(content), **content}


def load_sealed(path: Path) -> dict[str, Any]:
    """Content of a model file without its digest; files of others and of long ago have none.

    Raises InputError where the digest is of other content: a file that was cut short may still be
    YAML. The digest comes first in a file, so that no cut takes it alone.
    """
    content = yaml.load(path)
    stated = content.pop(SEAL, None)
    if stated not in (None, _digest(content)):
        raise InputError(
            f"{path}: was cut short or edited after it was written: bring the whole file back, or"
            f" delete its line {SEAL} where the edit is meant"
        )
    return content


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@contextmanager
def saved_arrays(path: Path, arrays: Mapping[str, Array]) -> Iterator[tuple[str, str]]:
    """Write arrays beside a model file that is then written; yield their file's name and digest.

    Raises InputError where the model file itself has that name, or cannot be written.
    """
    beside = path.with_suffix(".npz")
    if beside == path or path.is_dir():
        raise InputError(f"{path}: give the name of a file, as model.yaml; its arrays are in .npz")
    with writing(path):
        written = beside.with_name(f".{beside.stem}.{token_hex(4)}.npz")
        try:
            np.savez(written, **arrays)  # type: ignore[arg-type] # its stub takes a name for an option
            with written.open("rb") as stream:
                os.fsync(stream.fileno())
            digest = sha256_of(written)
            written = written.replace(_awaiting(beside, digest))
            yield beside.name, digest
            written.replace(beside)
            flush(beside.parent)
        finally:
            written.unlink(missing_ok=True)


def arrays_beside(path: Path, name: str, digest: str) -> Archive:
    """Open the arrays of a model file that states their name and digest, which may be empty."""
    beside = path.parent / name
    awaiting = _awaiting(beside, digest)
    return Archive(awaiting if awaiting.is_file() else beside)


def _awaiting(beside: Path, digest: str) -> Path:
    return beside.with_name(f"{beside.stem}.{digest[:16]}.npz") if digest else beside
