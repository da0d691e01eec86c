"""Paths that a user gives. Whatever is written, the folders that are missing are made."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

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


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a file to write, which then takes the place of one at ``path``.

    It lies beside it, of the same suffix. Whoever is killed at any moment leaves the old file or
    the new one. What is no ordinary file, as ``/dev/stdout``, is written itself. Otherwise as
    ``writing``.
    """
    with writing(path):
        target = path.resolve()
        if target.exists() and not target.is_file():
            yield path
            return
        beside = target.with_name(f".{target.stem}.{token_hex(4)}{target.suffix}")
        try:
            yield beside
            with beside.open("rb") as written:
                os.fsync(written.fileno())
            beside.replace(target)
        finally:
            beside.unlink(missing_ok=True)
        flush(target.parent)


def flush(folder: Path) -> None:
    """Have the operating system keep the names in a folder, where it can."""
    with suppress(OSError):
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


def write_text(path: Path, text: str) -> None:
    """Write a file of text; otherwise as ``replacing``."""
    with replacing(path) as beside:
        beside.write_text(text, "utf-8")


def refuse_unwritable(path: Path) -> None:
    """Raise InputError where a file or folder could not be written, before it is computed."""
    above = next(each for each in path.absolute().parents if each.exists())
    if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
        raise InputError(f"{path}: {above} is no folder that can be written to: give another")
