"""Images of Gwyddion, ``.gwy``, read and written by the package gwyfile.

A data field begins with the top row, at the highest y: Gwyddion's manual, "Gwyddion native format",
states the offsets as those of the top-left corner. Columns begin at the lowest x, also in a
retrace, since Gwyddion mirrors what instruments store otherwise. The format itself states neither
line time nor direction. Files of this package state both in the metadata of each channel.

An object is a name, a size and components, and a component a name, a letter for its type and its
data. gwyfile may never return from a file whose sizes are damaged, so they are checked before.
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import gwyfile
import numpy as np
from attrs import define
from gwyfile.objects import GwyContainer, GwyDataField

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import (
    Direction,
    FoundChannel,
    ImageChannel,
    ScanFacts,
    facts_of,
    in_si,
    metres,
    paired,
)
from afm_scan_ros.files.columns import Signal
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


def read(path: Path) -> Sequence[FoundChannel]:
    """Read all channels, paired by their titles; raises ValueError for a file cut short."""
    _Structure(path.read_bytes()).check()
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


def write(
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
    signals: Sequence[Signal],
) -> None:
    """Write the file; raises InputError for signals, and for words with a zero byte."""
    (path,) = targets
    if signals:
        raise InputError(f"{path}: a Gwyddion file holds no signals: write them to .nc or .csv")
    for words in (*stated.items(), *((each.name, each.unit) for each in channels)):
        if "\0" in "".join(words):
            raise InputError(f"{path}: '{words[0]}' holds a zero byte: leave it out")
    container = GwyContainer()
    for number, channel in enumerate(channels):
        container[f"/{number}/data"] = _data_field(channel)
        container[f"/{number}/data/title"] = channel.title
        container.typecodes[f"/{number}/data/title"] = TEXT
        container[f"/{number}/meta"] = GwyContainer(dict(stated), dict.fromkeys(stated, TEXT))
    with replacing(path) as beside:
        container.tofile(str(beside))


def _data_field(channel: ImageChannel) -> GwyDataField:
    return GwyDataField(
        np.ascontiguousarray(channel.values[::-1], dtype=np.float64),
        xreal=channel.range_x,
        yreal=channel.range_y,
        xoff=channel.left,
        yoff=channel.bottom,
        si_unit_xy="m",
        si_unit_z=channel.unit,
    )


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
