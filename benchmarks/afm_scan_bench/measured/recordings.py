"""Where the measurements recorded by others lie; none of them is part of the package."""

import os
from pathlib import Path

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import share_directory

VARIABLE = "AFM_SCAN_DATA"


def measured_data(name: str) -> Path:
    """Return the folder or file ``name`` below the folder that AFM_SCAN_DATA names.

    Without the variable that is ``../shared/data`` beside the source tree. Raises InputError
    where there is no such folder or file.
    """
    folder = os.environ.get(VARIABLE) or share_directory().parent / "shared/data"
    path = Path(folder) / name
    if not path.exists():
        raise InputError(
            f"{path}: no measurements there: set {VARIABLE} to the folder that holds {name}"
        )
    return path
