"""Images of Gwyddion, ``.gwy`` and ``.gsf``; the latter by the package gsffile.

Both formats begin with the top row, at the highest y: Gwyddion's manual, "Gwyddion native format"
and "Gwyddion Simple Field". Columns begin at the lowest x, also in a retrace, since Gwyddion
mirrors what instruments store otherwise. The formats state neither line time nor direction. Files
of this package state both: in the metadata of each channel, and as further fields.

A ``.gsf`` file holds one channel in one direction, of 32 bits. In a ``.gwy`` file, an object is a
name, a size and components, and a component a name, a letter for its type and its data. gwyfile
writes them. It is not used to read them: it never returns from some files whose sizes are damaged,
and it copies the rest of a file for each component.
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
NUMBERS: dict[str, np.dtype[Any]] = {"b": np.dtype("?"), "c": np.dtype("u1")}
NUMBERS |= {"i": np.dtype("<i4"), "q": np.dtype("<i8"), "d": np.dtype("<f8")}
"""Numbers by the letters of their types; a capital stands for an array of them."""
NO_UNIT = {"unitstr": ""}
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


def read_gwy(_: ModuleType, path: Path) -> Iterator[Direction]:
    """Read all channels; raises InputError for ranges that are no lengths."""
    container = _GwyParts(path.read_bytes()).container()
    for number in sorted(int(found[1]) for key in container if (found := FIELD.fullmatch(key))):
        field = container[f"/{number}/data"]
        title = str(container.get(f"/{number}/data/title", f"Channel {number}"))
        lateral, unit = (str(field.get(f"si_unit_{of}", NO_UNIT)["unitstr"]) for of in ("xy", "z"))
        range_x, range_y = (
            metres(f"the range of '{title}'", float(field[key]), lateral)
            for key in ("xreal", "yreal")
        )
        facts = facts_of(range_x, range_y, container.get(f"/{number}/meta", {}))
        rows = field["data"].reshape(field["yres"], field["xres"])[::-1]
        yield Direction(*split_title(title), unit, facts, np.asarray(rows, dtype=float))


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
class _GwyParts:
    """The parts of a file; methods return what begins at ``start``, and where it ends.

    They raise ValueError where it would end beyond ``stop``, and for too many parts.
    """

    content: bytes
    parts: int = 0

    def container(self) -> dict[str, Any]:
        """Return the components of a file by their names, those of objects within it likewise."""
        if not self.content.startswith(MAGIC):
            raise ValueError(f"it does not begin with {MAGIC.decode()}")
        found, end = self._object(len(MAGIC), len(self.content), DEEPEST)
        if end != len(self.content):
            raise ValueError(f"{len(self.content) - end} bytes follow what it states")
        return found

    def _object(self, start: int, stop: int, depth: int) -> tuple[dict[str, Any], int]:
        if not depth:
            raise ValueError(f"objects lie more than {DEEPEST} deep")
        _, place = self._text(start, stop)
        size, place = self._count(place, stop)
        end = _within(place + size, stop)
        found = {}
        while place < end:
            name, place = self._text(place, end)
            found[name], place = self._component(place, end, depth - 1)
        return found, end

    def _component(self, start: int, stop: int, depth: int) -> tuple[Any, int]:
        kind, place = self.content[start : start + 1].decode("latin-1"), _within(start + 1, stop)
        count, place = self._count(place, stop) if kind.isupper() else (1, place)
        found: Any = []
        if (number := NUMBERS.get(kind.lower())) is not None:
            end = _within(place + count * number.itemsize, stop)
            found, place = np.frombuffer(self.content, number, count, place), end
        elif kind in "sSoO":
            for _ in range(count):
                text = kind in "sS"
                each, place = self._text(place, stop) if text else self._object(place, stop, depth)
                found.append(each)
        else:
            raise ValueError(f"byte {place}: '{kind}' is no type")
        return found if kind.isupper() else found[0], place

    def _text(self, start: int, stop: int) -> tuple[str, int]:
        self.parts += 1
        if self.parts > MOST_PARTS:
            raise ValueError(f"it has more than {MOST_PARTS} parts")
        end = self.content.find(b"\0", start, stop)
        if end < 0:
            raise ValueError(f"byte {start}: a text has no end")
        return self.content[start:end].decode(), end + 1

    def _count(self, start: int, stop: int) -> tuple[int, int]:
        end = _within(start + COUNT.size, stop)
        return COUNT.unpack_from(self.content, start)[0], end


def _within(end: int, stop: int) -> int:
    if end > stop:
        raise ValueError(f"byte {stop}: a part would end at byte {end}")
    return end
