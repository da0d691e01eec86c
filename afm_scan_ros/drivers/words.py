"""What is said of an exception of a driver, in one line."""

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from afm_scan_ros.core.errors import InputError, ScanError


def printable(text: str) -> str:
    """Return a text with each control character, ends of lines too, as Python writes it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


@contextmanager
def refusing(what: str) -> Iterator[None]:
    """Raise InputError for whatever a driver raises before it moves, and log where it did."""
    try:
        yield
    except (InputError, ScanError):
        raise
    except Exception as error:
        _log(error)
        raise InputError(f"{what}: {_worded(error)}") from error


def described(error: BaseException | None) -> str:
    """Say what ended the work, and where if nobody foresaw it; log its traceback then."""
    if error is None or isinstance(error, InputError | ScanError):
        return str(error or "")
    _log(error)
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    with suppress(Exception):  # the outputs matter more
        *_, place = traceback.extract_tb(error.__traceback__)
        said += f" ({Path(place.filename).name}, line {place.lineno})"
    return said


def _worded(error: Exception) -> str:
    """Return what an exception says, by its name where that is nothing, or a key alone."""
    said, name = str(error), type(error).__name__
    if isinstance(error, LookupError):
        return f"{name}: {said}"
    return said or name


def _log(error: BaseException) -> None:
    """Print a traceback, where that is possible: the outputs matter more.

    Each line is marked, so that no text of an exception looks like a line of its own.
    """
    with suppress(Exception):
        lines = "".join(traceback.format_exception(error)).rstrip("\n").split("\n")
        sys.stderr.write("".join(f"| {printable(line)}\n" for line in lines))
