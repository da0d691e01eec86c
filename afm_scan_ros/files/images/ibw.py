"""Images of Asylum Research, ``.ibw``, by the package igor2.

Waves have the axes x, y and channel, and both x and y rise: AFMReader turns the rows round to have
the top first. Labels as ``HeightTrace`` and ``HeightRetrace`` state the directions. The columns of
a retrace run from the lowest x: Asylum's software shows both directions alike. The note states
``FastScanSize`` and ``SlowScanSize`` in m. ``ScanRate`` counts lines a second, trace and retrace
each, and ``ScanDown`` is 0 or 1. It states no overscan.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from igor2 import binarywave

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.found import Direction, FoundChannel, ScanFacts, in_si, paired
from afm_scan_ros.files.images.ibw_structure import check_structure

STACK = 3
"""Dimensions of a wave of images."""
UNITS = {"phase": "deg", "amplitude": "m", "height": "m", "zsensor": "m", "deflection": "m"}
"""Units of Asylum's channels, by the beginnings of their labels; the format states none."""
logging.getLogger("igor2").addHandler(logging.NullHandler())  # it logs what it then raises
UPWARD = {"0": True, "1": False}


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels; raises InputError or ValueError for a wave that is no image."""
    check_structure(path.read_bytes())
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
