"""Which rows of a table are taken."""

from pathlib import Path

from attrs import frozen

from afm_scan_ros.core.errors import InputError

LEAST = 2
"""Rows of a table, at least."""


@frozen
class Rows:
    """Lines left out at the top, then the first and the last row taken, counted from 1."""

    skipped: int = 0
    first: int = 1
    last: int | None = None

    def of(self, path: Path, count: int) -> slice:
        """Return which of ``count`` rows are taken; raises InputError where less than two are."""
        last = count if self.last is None else self.last
        if count < LEAST:
            raise InputError(f"{path}: {count} row of numbers: give {LEAST} at least")
        if not 1 <= self.first < last <= count:
            raise InputError(
                f"{path}: rows {self.first} to {last} of {count}: choose --start-row and --stop-row"
                " within them, with at least two rows"
            )
        return slice(self.first - 1, last)


EVERY = Rows()
