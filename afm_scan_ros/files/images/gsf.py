"""Images of the Gwyddion Simple Field format, ``.gsf``, by the package gsffile.

A file holds one channel in one direction. Gwyddion's manual, "Gwyddion Simple Field", states that
data are stored by rows from top to bottom, each from left to right. The format states neither line
time nor direction. Files of this package state both as further fields.
"""

from collections.abc import Sequence
from pathlib import Path

import gsffile
import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.found import (
    Direction,
    FoundChannel,
    ScanFacts,
    in_si,
    metres,
    paired,
)
from afm_scan_ros.files.images.stated import facts_of

RANGES = ("XReal", "YReal")


def read(path: Path) -> Sequence[FoundChannel]:
    """Read the only channel; raises InputError where its ranges are not stated."""
    values, stated = gsffile.read_gsf(path)
    for key in RANGES:
        if key not in stated:
            raise InputError(f"{path}: states no {key}: save it with its ranges in m")
    range_x, range_y = (metres(path, k, stated[k], stated.get("XYUnits", "")) for k in RANGES)
    numbers, unit = in_si(np.asarray(values, dtype=float)[::-1], stated.get("ZUnits", ""))
    facts = facts_of(path, ScanFacts(range_x, range_y), stated)
    return paired([Direction(stated.get("Title", "Channel"), unit, facts, numbers)])
