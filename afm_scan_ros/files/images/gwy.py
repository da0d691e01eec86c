"""Images of Gwyddion, ``.gwy``, by the package gwyfile.

A data field begins with the top row, at the highest y: Gwyddion's manual, "Gwyddion native format",
states the offsets as those of the top-left corner. Columns begin at the lowest x, also in a
retrace, since Gwyddion mirrors what instruments store otherwise. The format itself states neither
line time nor direction. Files of this package state both in the metadata of each channel.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import gwyfile
import numpy as np

from afm_scan_ros.files.images.found import (
    Direction,
    FoundChannel,
    ScanFacts,
    in_si,
    metres,
    paired,
)
from afm_scan_ros.files.images.gwy_structure import check_structure
from afm_scan_ros.files.images.stated import facts_of

FIELD = re.compile(r"/(\d+)/data")


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels, paired by their titles; raises ValueError for a file cut short."""
    check_structure(path.read_bytes())
    return paired(_directions(path, gwyfile.load(str(path))))


def _directions(path: Path, container: Mapping[str, Any]) -> Iterator[Direction]:
    numbers = sorted(int(found[1]) for key in container if (found := FIELD.fullmatch(key)))
    for number in numbers:
        field = container[f"/{number}/data"]
        title = str(container.get(f"/{number}/data/title", f"Channel {number}"))
        lateral = _unit(field.si_unit_xy)
        range_x, range_y = (
            metres(path, f"the range of '{title}'", float(length), lateral)
            for length in (field.xreal, field.yreal)
        )
        values, unit = in_si(np.asarray(field.data, dtype=float)[::-1], _unit(field.si_unit_z))
        meta = container.get(f"/{number}/meta", {})
        yield Direction(title, unit, facts_of(path, ScanFacts(range_x, range_y), meta), values)


def _unit(found: Mapping[str, Any] | None) -> str:
    return "" if found is None else str(found["unitstr"])
