"""Images of Bruker's Nanoscope, ``.spm``, by the package pySPM.

Rows run from the lowest y to the highest, whatever the slow direction: AFMReader turns pySPM's rows
round to have the top first. The columns of a retrace run from the lowest x, as Nanoscope shows
them: neither AFMReader nor Gwyddion turns them. ``Scan Rate`` counts lines a second, trace and
retrace each. ``Scan Size`` is the range in x, and ``Aspect Ratio`` that of x to y. ``Frame
direction`` is the slow direction. The format states no overscan.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pySPM

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import (
    Direction,
    FoundChannel,
    ScanFacts,
    in_si,
    metres,
    paired,
)
from afm_scan_ros.files.units import A_NUMBER

HEADER_END = re.compile(rb"^\\\*File list end\s*$", re.MULTILINE)
"""The header's last line; pySPM would look for it for ever."""
SCAN_RATE = re.compile(rf"\\Scan Rate: ({A_NUMBER})".encode())
TITLE = re.compile(r'.*"([^"]*)"')
LENGTH = b"Data length"
"""Bytes of a channel, which lie nowhere else."""
UPWARD = {"Up": True, "Down": False}
BACK = {"Trace": False, "Retrace": True}

Layer = Mapping[bytes, Sequence[bytes]]


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels; raises InputError for a file without the end of its header."""
    content = path.read_bytes()
    end = HEADER_END.search(content)
    if end is None:
        raise InputError(
            f"{path}: has no end of a Nanoscope header, it was cut short: copy it again"
        )
    rate = SCAN_RATE.search(content, 0, end.start())
    line_time = None if rate is None else 1.0 / float(rate[1])
    scan = pySPM.Bruker(str(path))
    stated = sum(int(layer.get(LENGTH, [b"0"])[0]) for layer in scan.layers)
    if stated > len(content):
        raise InputError(
            f"{path}: states {stated} bytes of samples, more than it has: copy it again"
        )
    return paired(_directions(path, scan, line_time))


def _directions(path: Path, scan: pySPM.Bruker, line_time: float | None) -> Iterator[Direction]:
    for layer in scan.layers:
        title = TITLE.match(_text(layer, "@2:Image Data"))
        if title is None:
            continue
        name, way = title[1], _text(layer, "Line Direction")
        image = scan.get_channel(name, backward=BACK[way], lazy=False)
        shape = tuple(int(_text(layer, key)) for key in ("Number of lines", "Samps/line"))
        if image.pixels.shape != shape:
            raise InputError(
                f"{path}: '{name}' holds {image.pixels.shape} of {shape} lines and pixels: save a"
                " whole image"
            )
        values, unit = in_si(np.asarray(image.pixels, dtype=float), image.zscale)
        yield Direction(f"{name} {way}", unit, _facts(path, layer, line_time), values)


def _facts(path: Path, layer: Layer, line_time: float | None) -> ScanFacts:
    size, _, unit = _text(layer, "Scan Size").split()
    width, height = (float(word) for word in _text(layer, "Aspect Ratio").split(":"))
    range_x = metres(path, "Scan Size", float(size), unit.replace("~", "u"))
    direction = _text(layer, "Frame direction")
    return ScanFacts(range_x, range_x * height / width, line_time, UPWARD.get(direction))


def _text(layer: Layer, name: str) -> str:
    """Return the value of a key, which versions write in capitals or not; empty if it is missing.

    What follows colons within it belongs to the value.
    """
    for key, words in layer.items():
        if key.decode("latin-1").lower() == name.lower():
            return ": ".join(word.decode("latin-1") for word in words).strip()
    return ""
