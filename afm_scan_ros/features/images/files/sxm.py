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
from afm_scan_ros.features.images.files.channels import (
    Direction,
    FoundChannel,
    ScanFacts,
    in_si,
    paired,
)

HEADER_END, BEGINNING = re.compile(rb"^:SCANIT_END:\s*$", re.MULTILINE), b"\x1a\x04"
"""What ends the header and begins the samples; pySPM would look for either for ever."""
PIXEL = 4
"""Bytes of a sample."""
UPWARD = {"up": True, "down": False}
BOTH = {"both": ("forward", "backward")}

Header = Mapping[str, Sequence[Sequence[str]]]


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels; raises InputError for a file without the end of its header."""
    content = path.read_bytes()
    end = HEADER_END.search(content)
    start = -1 if end is None else content.find(BEGINNING[:1], end.end())
    if content[start : start + 2] != BEGINNING:
        raise InputError(f"{path}: has no end of a Nanonis header, it was cut short: copy it again")
    scan = pySPM.SXM(str(path))
    _refuse_more(path, scan, len(content) - start - len(BEGINNING))
    return paired(_directions(path, scan))


def _refuse_more(path: Path, scan: Any, held: int) -> None:  # noqa: ANN401 - pySPM is not typed
    """Raise InputError where channels state more than the bytes that the file holds of samples."""
    ways = sum(len(BOTH.get(row[3], (row[3],))) for row in scan.header["DATA_INFO"][1:])
    stated = PIXEL * ways * scan.size["pixels"]["x"] * scan.size["pixels"]["y"]
    if not 0 < stated <= held:
        raise InputError(f"{path}: states {stated} bytes of samples, {held} follow: copy it again")


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
