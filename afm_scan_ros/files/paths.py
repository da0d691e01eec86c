"""Paths that a user gives. Whatever is written, the folders that are missing are made."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from afm_scan_ros.core.errors import InputError


def path_of(given: object, example: str) -> Path:
    """Return a path; raises InputError, with the example, for anything else and for none."""
    if not isinstance(given, str | os.PathLike):
        raise InputError(f"path is of type {type(given).__name__}: give a path, as {example!r}")
    if not os.fspath(given):
        raise InputError(f"path is empty: give a path, as {example!r}")
    return Path(given)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make the folder of a file that is then written.

    Raises InputError, which names the file, where the operating system refuses either.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path}: {reason}: give another file or folder") from None


def write_text(path: Path, text: str) -> None:
    """Write a file of text; otherwise as ``writing``."""
    with writing(path):
        path.write_text(text, "utf-8")


def refuse_unwritable(path: Path) -> None:
    """Raise InputError where a file or folder could not be written, before it is computed."""
    above = next(each for each in path.absolute().parents if each.exists())
    if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
        raise InputError(f"{path}: {above} is no folder that can be written to: give another")
