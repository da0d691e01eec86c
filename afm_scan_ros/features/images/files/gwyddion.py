"""Images of Gwyddion: ``.gwy`` by the package gwyfile, and ``.gsf`` by the package gsffile.

Both formats begin with the top row, at the highest y: Gwyddion's manual, "Gwyddion native format"
and "Gwyddion Simple Field". Columns begin at the lowest x, also in a retrace, since Gwyddion
mirrors what instruments store otherwise. The formats state neither line time nor direction. Files
of this package state both: in the metadata of each channel, and as further fields.

A ``.gsf`` file holds one channel in one direction, of 32 bits. In a ``.gwy`` file, an object is a
name, a size and components, and a component a name, a letter for its type and its data. gwyfile
may never return from a file whose sizes are damaged, so they are checked before.
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from attrs import define

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import (
    Direction,
    ImageChannel,
    facts_of,
    metres,
    split_title,
)
from afm_scan_ros.files.paths import replacing

FIELD = re.compile(r"/(\d+)/data")
TEXT = "s"
"""Code of gwyfile for text, which it would take for a single character where it has one."""
MAGIC = b"GWYP"
SIZES = {"b": 1, "c": 1, "i": 4, "q": 8, "d": 8}
"""Bytes of a number, by the letter of its type; its capital stands for an array of them."""
COUNT = struct.Struct("<I")
DEEPEST = 20
"""Objects within objects; a channel's unit is the third."""
MOST_PARTS = 10**5
"""Components and texts of a file, each of which takes hundreds of bytes in memory."""
RANGES = ("XReal", "YReal")
FORBIDDEN = ("=", "\n", "\r", "\0")
"""Characters that end the name or the value of a field of a ``.gsf`` file."""


def read_gsf(gsffile: ModuleType, path: Path) -> Iterator[Direction]:
    """Read the only channel; raises InputError where its ranges are not stated."""
    values, stated = gsffile.read_gsf(path)
    for key in RANGES:
        if key not in stated:
            raise InputError(f"states no {key}: save it with its ranges in m")
    range_x, range_y = (metres(key, stated[key], stated.get("XYUnits", "")) for key in RANGES)
    facts = facts_of(range_x, range_y, stated)
    title, unit = stated.get("Title", "Channel"), stated.get("ZUnits", "")
    yield Direction(*split_title(title), unit, facts, np.asarray(values, dtype=float)[::-1])


def write_gsf(
    gsffile: ModuleType,
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
) -> None:
    """Write a file a channel; raises InputError for what a file cannot hold, and writes none."""
    fields = [{**_fields(channel), **stated} for channel in channels]
    for path, channel, words in zip(targets, channels, fields, strict=True):
        for name, value in words.items():
            if any(mark in f"{name}{value}" for mark in FORBIDDEN):
                raise InputError(f"{path}: {name} holds '=' or a line end: leave it out")
        if np.abs(channel.values).max() > np.finfo(np.float32).max:
            raise InputError(f"{path}: a value is too large for 32 bits: write .gwy or .nc")
    for path, channel, words in zip(targets, channels, fields, strict=True):
        rows = np.ascontiguousarray(channel.values[::-1], dtype=np.float32)
        with replacing(path) as beside:
            gsffile.write_gsf(beside, rows, words)


def _fields(channel: ImageChannel) -> dict[str, str]:
    return {
        "XReal": repr(float(channel.range_x)),
        "YReal": repr(float(channel.range_y)),
        "XOffset": repr(float(channel.left)),
        "YOffset": repr(float(channel.bottom)),
        "Title": channel.title,
        "XYUnits": "m",
        "ZUnits": channel.unit,
    }


def read_gwy(gwyfile: ModuleType, path: Path) -> Iterator[Direction]:
    """Read all channels; raises InputError for ranges that are no lengths."""
    _Structure(path.read_bytes()).check()
    container = gwyfile.load(str(path))
    for number in sorted(int(found[1]) for key in container if (found := FIELD.fullmatch(key))):
        field = container[f"/{number}/data"]
        title = str(container.get(f"/{number}/data/title", f"Channel {number}"))
        range_x, range_y = (
            metres(f"the range of '{title}'", float(length), _unit(field.si_unit_xy))
            for length in (field.xreal, field.yreal)
        )
        facts = facts_of(range_x, range_y, container.get(f"/{number}/meta", {}))
        rows = np.asarray(field.data, dtype=float)[::-1]
        yield Direction(*split_title(title), _unit(field.si_unit_z), facts, rows)


def _unit(found: Mapping[str, Any] | None) -> str:
    return "" if found is None else str(found["unitstr"])


def write_gwy(
    gwyfile: ModuleType,
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
) -> None:
    """Write the file; raises InputError for words with a zero byte."""
    (path,) = targets
    for words in (*stated.items(), *((each.name, each.unit) for each in channels)):
        if "\0" in "".join(words):
            raise InputError(f"{path}: '{words[0]}' holds a zero byte: leave it out")
    parts = gwyfile.objects
    container = parts.GwyContainer()
    for number, channel in enumerate(channels):
        container[f"/{number}/data"] = parts.GwyDataField(
            np.ascontiguousarray(channel.values[::-1], dtype=np.float64),
            xreal=channel.range_x,
            yreal=channel.range_y,
            xoff=channel.left,
            yoff=channel.bottom,
            si_unit_xy="m",
            si_unit_z=channel.unit,
        )
        container[f"/{number}/data/title"] = channel.title
        container.typecodes[f"/{number}/data/title"] = TEXT
        container[f"/{number}/meta"] = parts.GwyContainer(dict(stated), dict.fromkeys(stated, TEXT))
    with replacing(path) as beside:
        container.tofile(str(beside))


@define
class _Structure:
    """The parts of a file; methods return where a part ends that begins at ``start``.

    They raise ValueError where it would end beyond ``stop``, and for too many parts.
    """

    content: bytes
    parts: int = 0

    def check(self) -> None:
        """Raise ValueError where a file does not begin as one, or a part ends elsewhere."""
        if not self.content.startswith(MAGIC):
            raise ValueError(f"it does not begin with {MAGIC.decode()}")
        end = self._object(len(MAGIC), len(self.content), DEEPEST)
        if end != len(self.content):
            raise ValueError(f"{len(self.content) - end} bytes follow what it states")

    def _object(self, start: int, stop: int, depth: int) -> int:
        if not depth:
            raise ValueError(f"objects lie more than {DEEPEST} deep")
        place = self._text(start, stop)
        size, place = self._count(place, stop)
        end = _within(place + size, stop)
        while place < end:
            place = self._component(place, end, depth - 1)
        return end

    def _component(self, start: int, stop: int, depth: int) -> int:
        place = self._text(start, stop)
        kind, place = self.content[place : place + 1].decode("latin-1"), _within(place + 1, stop)
        if kind in SIZES:
            return _within(place + SIZES[kind], stop)
        count = 1
        if kind.isupper():
            count, place = self._count(place, stop)
        single = kind.lower()
        if single in SIZES:
            return _within(place + count * SIZES[single], stop)
        if single not in ("s", "o"):
            raise ValueError(f"byte {place}: '{kind}' is no type")
        for _ in range(count):
            place = self._text(place, stop) if single == "s" else self._object(place, stop, depth)
        return place

    def _text(self, start: int, stop: int) -> int:
        """Return where the text ends, its zero included."""
        self.parts += 1
        if self.parts > MOST_PARTS:
            raise ValueError(f"it has more than {MOST_PARTS} parts")
        end = self.content.find(b"\0", start, stop)
        if end < 0:
            raise ValueError(f"byte {start}: a text has no end")
        return end + 1

    def _count(self, start: int, stop: int) -> tuple[int, int]:
        end = _within(start + COUNT.size, stop)
        return COUNT.unpack_from(self.content, start)[0], end


def _within(end: int, stop: int) -> int:
    if end > stop:
        raise ValueError(f"byte {stop}: a part would end at byte {end}")
    return end
