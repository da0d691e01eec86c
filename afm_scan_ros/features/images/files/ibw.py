"""Images of Asylum Research, ``.ibw``, by the package igor2.

Waves have the axes x, y and channel, and both x and y rise: AFMReader turns the rows round to have
the top first. Labels as ``HeightTrace`` and ``HeightRetrace`` state the directions. The columns of
a retrace run from the lowest x: Asylum's software shows both directions alike. The note states
``FastScanSize`` and ``SlowScanSize`` in m. ``ScanRate`` counts lines a second, trace and retrace
each, and ``ScanDown`` is 0 or 1. It states no overscan.

igor2 takes any memory for sizes that are damaged, so they are checked before. The headers are those
of version 5, the only one with several dimensions: Technical Note 3 of WaveMetrics, "Igor Binary
Format".
"""

import logging
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from igor2 import binarywave

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import (
    Direction,
    FoundChannel,
    ScanFacts,
    in_si,
    paired,
)

STACK = 3
"""Dimensions of a wave of images."""
UNITS = {"phase": "deg", "amplitude": "m", "height": "m", "zsensor": "m", "deflection": "m"}
"""Units of Asylum's channels, by the beginnings of their labels; the format states none."""
logging.getLogger("igor2").addHandler(logging.NullHandler())  # it logs what it then raises
UPWARD = {"0": True, "1": False}
VERSION = 5
LENGTHS = "hhi14i"
"""Version, checksum and lengths of the parts: header with samples, formula, note, units, labels."""
RESERVED = 2
"""Numbers at the end of these that are no lengths."""
FILE_HEADER, WAVE_HEADER = 64, 320
SAMPLES, DIMENSIONS = FILE_HEADER + 12, FILE_HEADER + 68
"""Where the number of samples stands, and that along each dimension."""


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels; raises InputError or ValueError for a wave that is no image."""
    _check_structure(path.read_bytes())
    wave = binarywave.load(str(path))["wave"]
    values = np.asarray(wave["wData"], dtype=float)
    if values.ndim != STACK:
        raise InputError(f"{path}: a wave of {values.ndim} dimensions: give an image of Asylum's")
    return paired(_directions(path, wave, values))


def _directions(path: Path, wave: Mapping[str, Any], values: Any) -> Iterator[Direction]:  # noqa: ANN401
    facts = _facts(path, bytes(wave["note"]).decode("latin-1"))
    labels = [label.decode("latin-1") for label in wave["labels"][2] if label]
    if len(labels) != values.shape[2]:
        raise InputError(
            f"{path}: {values.shape[2]} channels have {len(labels)} labels: save again"
        )
    for number, label in enumerate(labels):
        unit = next((u for name, u in UNITS.items() if label.lower().startswith(name)), "")
        numbers, si = in_si(values[:, :, number].T, unit)
        yield Direction(label, si, facts, numbers)


def _facts(path: Path, note: str) -> ScanFacts:
    pairs = (line.partition(":") for line in note.replace("\n", "\r").split("\r"))
    stated = {key.strip(): value.strip() for key, colon, value in pairs if colon}
    for key in ("FastScanSize", "SlowScanSize"):
        if key not in stated:
            raise InputError(f"{path}: its note states no {key}: give an image of Asylum's")
    return ScanFacts(
        float(stated["FastScanSize"]),
        float(stated["SlowScanSize"]),
        1.0 / float(stated["ScanRate"]) if "ScanRate" in stated else None,
        UPWARD.get(stated.get("ScanDown", "")),
    )


def _check_structure(content: bytes) -> None:
    """Raise ValueError for another version, and for parts longer than the file.

    Asylum's own words may follow the wave.
    """
    order = next((o for o in "<>" if content[:2] == struct.pack(f"{o}h", VERSION)), None)
    if order is None:
        raise ValueError(f"it is no wave of version {VERSION}")
    if len(content) < FILE_HEADER + WAVE_HEADER:
        raise ValueError(f"{len(content)} bytes hold no header")
    lengths = struct.unpack_from(order + LENGTHS, content)[2:-RESERVED]
    if min(lengths) < 0 or FILE_HEADER + sum(lengths) > len(content):
        raise ValueError(f"{len(content)} bytes, where {FILE_HEADER + sum(lengths)} are stated")
    (samples,) = struct.unpack_from(f"{order}i", content, SAMPLES)
    dimensions = struct.unpack_from(f"{order}4i", content, DIMENSIONS)
    used = dimensions[: dimensions.index(0)] if 0 in dimensions else dimensions
    if math.prod(used) != samples or not 0 < samples <= lengths[0] - WAVE_HEADER:
        raise ValueError(f"{samples} samples in dimensions {used} and {lengths[0]} bytes")
