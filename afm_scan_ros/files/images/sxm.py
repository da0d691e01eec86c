"""Images of Nanonis, ``.sxm``, by the package pySPM.

Nanonis stores samples in the order of their acquisition. Of a scan with ``SCAN_DIR`` down the first
row is therefore the highest, and the columns of ``backward`` run from the highest x. Gwyddion's
module ``nanonis.c`` turns both in the same way. ``SCAN_TIME`` holds the times of a forward and of
a backward line (s): "Nanonis File Format Version 1". The format states no overscan.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pySPM

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.channels import Direction, FoundChannel, ScanFacts, in_si, paired

HEADER_END = re.compile(rb"^:SCANIT_END:\s*\n[^\x1a]*\x1a\x04", re.MULTILINE)
"""What follows the header; pySPM would look for it for ever."""
UPWARD = {"up": True, "down": False}
BOTH = {"both": ("forward", "backward")}

Header = Mapping[str, Sequence[Sequence[str]]]


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels; raises InputError for a file without the end of its header."""
    if not HEADER_END.search(path.read_bytes()):
        raise InputError(f"{path}: has no end of a Nanonis header, it was cut short: copy it again")
    scan = pySPM.SXM(str(path))
    return paired(_directions(path, scan))


def _directions(path: Path, scan: Any) -> Iterator[Direction]:  # noqa: ANN401 - pySPM is not typed
    facts = _facts(path, scan.header)
    columns, *rows = scan.header["DATA_INFO"]
    for row in rows:
        stated = dict(zip(columns, row, strict=False))
        name, ways = stated["Name"], stated["Direction"]
        for way in BOTH.get(ways, (ways,)):
            values = np.asarray(scan.get_channel(name, direction=way).pixels, dtype=float)
            upward = values if facts.upward else values[::-1]
            turned = upward[:, ::-1] if way == "backward" else upward
            numbers, unit = in_si(turned, stated["Unit"])
            yield Direction(f"{name} {way}", unit, facts, numbers)


def _facts(path: Path, header: Header) -> ScanFacts:
    direction = header["SCAN_DIR"][0][0]
    if direction not in UPWARD:
        raise InputError(f"{path}: SCAN_DIR is '{direction}': give an image scanned up or down")
    range_x, range_y = (float(word) for word in header["SCAN_RANGE"][0][:2])
    times = [float(word) for word in header["SCAN_TIME"][0]] if "SCAN_TIME" in header else []
    line_time = sum(times) if len(times) == 2 else None  # noqa: PLR2004 - forward and backward
    return ScanFacts(range_x, range_y, line_time, UPWARD[direction])
