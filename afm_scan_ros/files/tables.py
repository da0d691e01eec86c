"""Tables of numbers in files that no ROS recorded: text, and arrays of numpy and MATLAB."""

from pathlib import Path
from typing import Protocol

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.array_table import read_archive, read_array, read_matlab
from afm_scan_ros.files.text_table import read_text

ARRAYS = {".npy": read_array, ".npz": read_archive, ".mat": read_matlab}


class NumberTable(Protocol):
    """Columns; counted from 0 here, from 1 by people and in messages."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
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
    """Read a file of arrays, or a text file without its first ``skipped`` lines.

    Raises InputError where it is neither, holds no rows, or has ragged ones.
    """
    if not path.is_file():
        raise InputError(f"{path}: is no file: give a table of text, .npy, .npz or .mat")
    read = ARRAYS.get(path.suffix.lower())
    if read is None:
        return read_text(path, skipped)
    if skipped:
        raise InputError(f"{path}: an array has no lines to skip: omit --skip-rows")
    return read(path)
