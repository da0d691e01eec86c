"""Tables of numbers in files that no ROS recorded."""

from pathlib import Path
from typing import Protocol

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.array_table import read_array
from afm_scan_ros.files.text_table import read_text


class NumberTable(Protocol):
    """Columns of one length; counted from 0 here, from 1 by people and in messages."""

    @property
    def heading(self) -> tuple[str, ...]:
        """Names of the columns, empty where the file gives none."""
        ...

    @property
    def width(self) -> int:
        """Number of columns."""
        ...

    def column(self, index: int) -> Array:
        """Numbers of a column, shape (rows,); raises InputError naming the cell that is none."""
        ...


def read_table(path: Path, skipped: int = 0) -> NumberTable:
    """Read a ``.npy`` array, or a text file without its first ``skipped`` lines.

    Raises InputError where it is neither, holds no rows, or has ragged ones.
    """
    if path.suffix != ".npy":
        return read_text(path, skipped)
    if skipped:
        raise InputError(f"{path}: an array has no lines to skip: leave --skip-rows out")
    return read_array(path)
