"""Signals of a scan as text: one row a sample, with headings that ``import-csv`` reads back."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from afm_scan_ros.files.images.channels import Signal

BLOCK = 100_000
"""Rows that are held as text at once."""
EXACT = "%.17g"
"""Digits that give back every float."""


def write_signals(path: Path, signals: Sequence[Signal]) -> None:
    """Write signals of one length as columns, with headings as ``drive_x [V]``."""
    rows = len(signals[0].values)
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(f"{each.name} [{each.unit}]" for each in signals) + "\n")
        for first in range(0, rows, BLOCK):
            block = [each.values[first : first + BLOCK] for each in signals]
            np.savetxt(file, np.column_stack(block), fmt=EXACT, delimiter=",")
