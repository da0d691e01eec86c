"""A model file and the arrays beside it, which are a pair at any moment, whoever is killed.

The model file states the digest of both. Arrays that are new lie beside it by their digest until
the model file that states it is there. Then they take the place of those before.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex
from typing import Any

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import yaml
from afm_scan_ros.files.arrays import Archive, sha256_of
from afm_scan_ros.files.paths import flush, writing

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
