"""Matrices too large for YAML, in an .npz file that need not be trusted."""

import hashlib
import io
import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.npy import check_header

LARGEST = 2**24  # bytes, a matrix of 1448 rows


class Archive:
    """The .npz file beside a model file; raises InputError for what cannot be trusted in it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read: set[str] = set()
        try:
            with zipfile.ZipFile(path) as archive:
                self._sizes = {info.filename: info.file_size for info in archive.infolist()}
        except FileNotFoundError as error:
            raise InputError(f"{path}: no such file; it must lie beside the model file") from error
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{path}: not an .npz file: {error}") from error

    def matrix(self, name: str) -> Array:
        """Square matrix of that name, float64."""
        self._read.add(f"{name}.npy")
        size = self._sizes.get(f"{name}.npy")
        if size is None:
            raise InputError(f"{self._path}: no array '{name}' among {', '.join(self._sizes)}")
        if size > LARGEST:
            raise InputError(f"{self._path}: '{name}' has {size} bytes, over {LARGEST}")
        values = self._array(name)
        if values.dtype != np.float64 or values.ndim != 2 or len(set(values.shape)) != 1:  # noqa: PLR2004
            found = f"{values.dtype} of shape {values.shape}"
            raise InputError(f"{self._path}: '{name}' should be a square of float64, not {found}")
        return np.asarray(values, dtype=np.float64)

    def unread(self) -> list[str]:
        """Names of the arrays that nobody has asked for."""
        return [name.removesuffix(".npy") for name in self._sizes if name not in self._read]

    def sha256(self) -> str:
        """Digest of the whole file, as ``sha256sum`` prints it."""
        with self._path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    def _array(self, name: str) -> Array:
        try:
            with zipfile.ZipFile(self._path) as archive:
                content = io.BytesIO(archive.read(f"{name}.npy"))
            check_header(content, len(content.getbuffer()))
            values: Array = npy.read_array(content, allow_pickle=False)
        except Exception as error:  # zipfile raises whatever a damaged file makes it run into
            raise InputError(f"{self._path}: array '{name}' is damaged: {error}") from error
        return values
