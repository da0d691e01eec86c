"""Numbers in a numpy ``.npy`` file."""

from pathlib import Path

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.npy import check_header


@frozen(eq=False)
class ArrayTable:
    """Rows along an array's first axis; its other axes make columns, the last one running first."""

    path: Path
    cells: Array = field(repr=False)

    @property
    def heading(self) -> tuple[str, ...]:
        """No names: an array has none."""
        return ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.cells.shape[1])

    def column(self, index: int) -> Array:
        """Numbers of a column, shape (rows,); raises InputError naming a row that is not finite."""
        numbers = self.cells[:, index]
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise InputError(
                f"{self.path}: row {bad[0] + 1}, column {index + 1}: {numbers[bad[0]]} is not"
                " finite: choose rows with --start-row and --stop-row"
            )
        return numbers


def read_array(path: Path) -> ArrayTable:
    """Read an array of real numbers; raises InputError where the file holds no such thing."""
    try:
        with path.open("rb") as stream:
            check_header(stream, path.stat().st_size)
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise InputError(f"{path}: no array that numpy can read: {error}") from error
    real = np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)
    if not real or array.size == 0 or array.ndim == 0:
        raise InputError(
            f"{path}: holds {array.dtype} of shape {array.shape}: give real numbers, the samples"
            " along the first axis"
        )
    return ArrayTable(path, np.asarray(array.reshape(len(array), -1), dtype=np.float64))
