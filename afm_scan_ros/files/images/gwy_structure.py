"""Whether a file of Gwyddion holds together: gwyfile may never return from one that does not.

The format is that of Gwyddion's manual, "Gwyddion native format": an object is a name, a size and
components, and a component a name, a letter for its type and its data.
"""

import struct

MAGIC = b"GWYP"
SIZES = {"b": 1, "c": 1, "i": 4, "q": 8, "d": 8}
"""Bytes of a number, by the letter of its type; its capital stands for an array of them."""
COUNT = struct.Struct("<I")
DEEPEST = 20
"""Objects within objects; a channel's unit is the third."""


def check_structure(content: bytes) -> None:
    """Raise ValueError where a file does not begin as one, or a part ends where it should not."""
    if not content.startswith(MAGIC):
        raise ValueError(f"it does not begin with {MAGIC.decode()}")
    end = _object(content, len(MAGIC), len(content), DEEPEST)
    if end != len(content):
        raise ValueError(f"{len(content) - end} bytes follow what it states")


def _object(content: bytes, start: int, stop: int, depth: int) -> int:
    """Return where an object ends that begins at ``start`` and must end by ``stop``."""
    if not depth:
        raise ValueError(f"objects lie more than {DEEPEST} deep")
    place = _text(content, start, stop)
    size, place = _count(content, place, stop)
    end = _within(place + size, stop)
    while place < end:
        place = _component(content, place, end, depth - 1)
    return end


def _component(content: bytes, start: int, stop: int, depth: int) -> int:
    place = _text(content, start, stop)
    kind, place = content[place : place + 1].decode("latin-1"), _within(place + 1, stop)
    if kind in SIZES:
        return _within(place + SIZES[kind], stop)
    count = 1
    if kind.isupper():
        count, place = _count(content, place, stop)
    single = kind.lower()
    if single in SIZES:
        return _within(place + count * SIZES[single], stop)
    if single not in ("s", "o"):
        raise ValueError(f"byte {place}: '{kind}' is no type")
    for _ in range(count):
        text = single == "s"
        place = _text(content, place, stop) if text else _object(content, place, stop, depth)
    return place


def _text(content: bytes, start: int, stop: int) -> int:
    """Return where the text ends that begins at ``start``, its zero included."""
    end = content.find(b"\0", start, stop)
    if end < 0:
        raise ValueError(f"byte {start}: a text has no end")
    return end + 1


def _count(content: bytes, start: int, stop: int) -> tuple[int, int]:
    end = _within(start + COUNT.size, stop)
    return COUNT.unpack_from(content, start)[0], end


def _within(end: int, stop: int) -> int:
    if end > stop:
        raise ValueError(f"byte {stop}: a part would end at byte {end}")
    return end
