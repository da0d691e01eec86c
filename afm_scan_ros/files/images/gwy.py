"""Images of Gwyddion, ``.gwy``, by the package gwyfile.

A data field begins with the top row, at the highest y: Gwyddion's manual, "Gwyddion native format",
states the offsets as those of the top-left corner. Columns begin at the lowest x, also in a
retrace, since Gwyddion mirrors what instruments store otherwise. The format itself states neither
line time nor direction. Files of this package state both in the metadata of each channel.
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import gwyfile
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

MAGIC = b"GWYP"
FIELD = re.compile(r"/(\d+)/data")


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels, paired by their titles; raises InputError for a file cut short."""
    _refuse_cut(path)
    return paired(_directions(path, gwyfile.load(str(path))))


def _refuse_cut(path: Path) -> None:
    """Raise InputError for another length than stated, which gwyfile does not look at."""
    content = path.read_bytes()
    end = content.find(b"\0") + 1
    (stated,) = struct.unpack("<I", content[end : end + 4])
    if not content.startswith(MAGIC) or len(content) - end - 4 != stated:
        raise InputError(
            f"{path}: is no Gwyddion file, or was cut short: save it with Gwyddion 2 or later"
        )


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
