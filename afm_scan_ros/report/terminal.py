"""Text on the terminal: whatever a file or a node puts into it, it is shown and does nothing."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from unicodedata import category

import click

LONGEST = 4000
"""Characters of a line, more than any sentence of ours: a name in a file may be a million."""


def visible(text: str) -> str:
    r"""Return text with every character that would not be seen as its number, as ``\x1b``.

    These are control characters, line ends among them, marks that turn the direction of writing,
    and others that have no shape. A line that is very long is shortened in its middle.
    """
    shown = "".join(
        one if one.isprintable() or category(one) == "Zs" else one.encode("unicode_escape").decode()
        for one in text
    )
    if len(shown) <= LONGEST:
        return shown
    half = LONGEST // 2
    return f"{shown[:half]} … {len(shown) - 2 * half} characters … {shown[-half:]}"


def say(text: object, *, err: bool = False) -> None:
    """Write one line to stdout or stderr."""
    click.echo(visible(str(text)), err=err)


def complain(prefix: str, text: object) -> None:
    """Write one line to stderr, line ends and other white space of the text as blanks."""
    say(f"{prefix}: {' '.join(str(text).split())}", err=True)


class _ToStderr(logging.Handler):
    """Shows what is logged as the commands show their own messages."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        complain(record.levelname.lower(), record.getMessage())


@contextmanager
def showing_log() -> Iterator[None]:
    """Show what the package logs, once, however often this is entered."""
    log, handler = logging.getLogger("afm_scan_ros"), _ToStderr()
    shown = any(isinstance(each, _ToStderr) for each in log.handlers)
    if not shown:
        log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
