"""Images of Bruker's Nanoscope, ``.spm``, of Nanonis, ``.sxm``, and of Asylum, ``.ibw``.

pySPM reads the first two and igor2 the third. All state the time of a line and the slow direction,
and none an overscan. The packages read damaged files for ever, or take any memory for sizes that
are damaged, so both are checked before.

``.spm``: rows run from the lowest y to the highest, whatever the slow direction: AFMReader turns
pySPM's rows round to have the top first. The columns of a retrace run from the lowest x, as
Nanoscope shows them: neither AFMReader nor Gwyddion turns them. ``Scan Rate`` counts lines a
second, trace and retrace each. ``Scan Size`` is the range in x, and ``Aspect Ratio`` that of x to
y, as ``2:1``. A scan that was captured before its end states a single number that is not the ratio:
Nanoscope shows 300 by 210 nm for 512 by 358 pixels and ``0.516184`` (issue 38 of pySPM). Its pixels
are taken as square, as by pySPM. ``Frame direction`` is the slow direction.

``.sxm``: samples are stored in the order of their acquisition. Of a scan with ``SCAN_DIR`` down the
first row is therefore the highest, and the columns of ``backward`` run from the highest x.
Gwyddion's module ``nanonis.c`` turns both in the same way. ``SCAN_TIME`` holds the times of a
forward and of a backward line (s): "Nanonis File Format Version 1".

``.ibw``: waves have the axes x, y and channel, and both x and y rise: AFMReader turns the rows
round to have the top first. Labels as ``HeightTrace`` and ``HeightRetrace`` state the directions.
The columns of a retrace run from the lowest x: Asylum's software shows both directions alike. The
note states ``FastScanSize`` and ``SlowScanSize`` in m. ``ScanRate`` counts lines a second, trace
and retrace each, and ``ScanDown`` is 0 or 1. The headers that are checked are those of version 5,
the only one with several dimensions: Technical Note 3 of WaveMetrics, "Igor Binary Format".
"""

import logging
import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import (
    UPWARD,
    Direction,
    ScanFacts,
    metres,
    split_title,
)
from afm_scan_ros.files.units import A_NUMBER

SPM_END = re.compile(rb"^\\\*File list end\s*$", re.MULTILINE)
"""The header's last line."""
SCAN_RATE = re.compile(rf"\\Scan Rate: ({A_NUMBER})".encode())
ROTATED = re.compile(rf"\\Rotate Ang\.: ({A_NUMBER})".encode())
TITLE = re.compile(r'.*"([^"]*)"')
LENGTH = b"Data length"
"""Bytes of a channel, which lie nowhere else."""
BACK = {"Trace": False, "Retrace": True}

Layer = Mapping[bytes, Sequence[bytes]]


def read_spm(spm: ModuleType, path: Path) -> Iterator[Direction]:
    """Read all channels; raises InputError for a file without the end of its header."""
    content = path.read_bytes()
    end = SPM_END.search(content)
    if end is None:
        raise InputError("has no end of a Nanoscope header, it was cut short: copy it again")
    rate = SCAN_RATE.search(content, 0, end.start())
    line_time = None if rate is None else 1.0 / float(rate[1])
    rotated = ROTATED.search(content, 0, end.start())
    angle = 0.0 if rotated is None else float(rotated[1])
    scan = spm.Bruker(str(path))
    stated = sum(int(layer.get(LENGTH, [b"0"])[0]) for layer in scan.layers)
    if stated > len(content):
        raise InputError(f"states {stated} bytes of samples, more than it has: copy it again")
    for layer in scan.layers:
        title = TITLE.match(_text(layer, "@2:Image Data"))
        if title is None:
            continue
        name, back = title[1], BACK[_text(layer, "Line Direction")]
        image = scan.get_channel(name, backward=back, lazy=False)
        shape = tuple(int(_text(layer, key)) for key in ("Number of lines", "Samps/line"))
        if image.pixels.shape != shape:
            raise InputError(
                f"'{name}' holds {image.pixels.shape} of {shape} lines and pixels: save a whole"
                " image"
            )
        values = np.asarray(image.pixels, dtype=float)
        facts = evolve(_spm_facts(layer), line_time=line_time, angle=angle)
        yield Direction(name, back, image.zscale, facts, values)


def _spm_facts(layer: Layer) -> ScanFacts:
    size, _, unit = _text(layer, "Scan Size").split()
    width, colon, height = _text(layer, "Aspect Ratio").partition(":")
    if not colon:
        height, width = _text(layer, "Number of lines"), _text(layer, "Samps/line")
    range_x = metres("Scan Size", float(size), unit.replace("~", "u"))
    upward = UPWARD.get(_text(layer, "Frame direction").lower())
    return ScanFacts(range_x, range_x * float(height) / float(width), upward=upward)


def _text(layer: Layer, name: str) -> str:
    """Return the value of a key, which versions write in capitals or not; empty if it is missing.

    What follows colons within it belongs to the value.
    """
    for key, words in layer.items():
        if key.decode("latin-1").lower() == name.lower():
            return ": ".join(word.decode("latin-1") for word in words).strip()
    return ""


SXM_END, SXM_SAMPLES = re.compile(rb"^:SCANIT_END:\s*$", re.MULTILINE), b"\x1a\x04"
"""What ends the header and begins the samples."""
PIXEL = 4
"""Bytes of a sample."""
WAYS = {"forward": ["forward"], "backward": ["backward"], "both": ["forward", "backward"]}


def read_sxm(spm: ModuleType, path: Path) -> Iterator[Direction]:
    """Read all channels; raises InputError for a file without the end of its header.

    So it does where the channels state more than the bytes that the file holds of samples.
    """
    content = path.read_bytes()
    end = SXM_END.search(content)
    start = -1 if end is None else content.find(SXM_SAMPLES[:1], end.end())
    if content[start : start + 2] != SXM_SAMPLES:
        raise InputError("has no end of a Nanonis header, it was cut short: copy it again")
    scan = spm.SXM(str(path))
    columns, *rows = scan.header["DATA_INFO"]
    held = len(content) - start - len(SXM_SAMPLES)
    ways = sum(len(WAYS[row[3]]) for row in rows)
    stated = PIXEL * ways * scan.size["pixels"]["x"] * scan.size["pixels"]["y"]
    if not 0 < stated <= held:
        raise InputError(f"states {stated} bytes of samples, {held} follow: copy it again")
    facts = _sxm_facts(scan.header)
    for row in rows:
        channel = dict(zip(columns, row, strict=False))
        name = channel["Name"]
        for each in WAYS[channel["Direction"]]:
            values = np.asarray(scan.get_channel(name, direction=each).pixels, dtype=float)
            upward = values if facts.upward else values[::-1]
            back = each == "backward"
            yield Direction(name, back, channel["Unit"], facts, upward[:, ::-1] if back else upward)


def _sxm_facts(header: Mapping[str, Sequence[Sequence[str]]]) -> ScanFacts:
    direction = header["SCAN_DIR"][0][0]
    if direction not in UPWARD:
        raise InputError(f"SCAN_DIR is '{direction}': give an image scanned up or down")
    range_x, range_y = (float(word) for word in header["SCAN_RANGE"][0][:2])
    angle = float(header["SCAN_ANGLE"][0][0]) if "SCAN_ANGLE" in header else 0.0
    facts = ScanFacts(range_x, range_y, upward=UPWARD[direction], angle=angle)
    times = [float(word) for word in header["SCAN_TIME"][0]] if "SCAN_TIME" in header else []
    if len(times) != 2 or not sum(times) > 0.0:  # noqa: PLR2004 - forward and backward
        return facts
    share = times[0] / sum(times) if times[0] != times[1] else None
    return evolve(facts, line_time=sum(times), trace_share=share)


STACK = 3
"""Dimensions of a wave of images."""
UNITS = {"phase": "deg", "amplitude": "m", "height": "m", "zsensor": "m", "deflection": "m"}
"""Units of Asylum's channels, by the beginnings of their labels; the format states none."""
SCAN_DOWN = {"0": True, "1": False}
logging.getLogger("igor2").addHandler(logging.NullHandler())  # it logs what it then raises
VERSION = 5
LENGTHS = "hhi14i"
"""Version, checksum and lengths of the parts: header with samples, formula, note, units, labels."""
RESERVED = 2
"""Numbers at the end of these that are no lengths."""
FILE_HEADER, WAVE_HEADER = 64, 320
SAMPLES, DIMENSIONS = FILE_HEADER + 12, FILE_HEADER + 68
"""Where the number of samples stands, and that along each dimension."""


def read_ibw(binarywave: ModuleType, path: Path) -> Iterator[Direction]:
    """Read all channels; raises InputError or ValueError for a wave that is no image."""
    _check_wave(path.read_bytes())
    wave = binarywave.load(str(path))["wave"]
    values = np.asarray(wave["wData"], dtype=float)
    if values.ndim != STACK:
        raise InputError(f"a wave of {values.ndim} dimensions: give an image of Asylum's")
    facts = _ibw_facts(bytes(wave["note"]).decode("latin-1"))
    labels = [label.decode("latin-1") for label in wave["labels"][2] if label]
    if len(labels) != values.shape[2]:
        raise InputError(f"{values.shape[2]} channels have {len(labels)} labels: save again")
    for number, label in enumerate(labels):
        unit = next((u for name, u in UNITS.items() if label.lower().startswith(name)), "")
        yield Direction(*split_title(label), unit, facts, values[:, :, number].T)


def _ibw_facts(note: str) -> ScanFacts:
    pairs = (line.partition(":") for line in note.replace("\n", "\r").split("\r"))
    stated = {key.strip(): value.strip() for key, colon, value in pairs if colon}
    for key in ("FastScanSize", "SlowScanSize"):
        if key not in stated:
            raise InputError(f"its note states no {key}: give an image of Asylum's")
    return ScanFacts(
        float(stated["FastScanSize"]),
        float(stated["SlowScanSize"]),
        1.0 / float(stated["ScanRate"]) if "ScanRate" in stated else None,
        SCAN_DOWN.get(stated.get("ScanDown", "")),
        angle=float(stated.get("ScanAngle", 0.0)),
    )


def _check_wave(content: bytes) -> None:
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
