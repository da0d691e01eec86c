"""Damage to a file, drawn from a generator: what disks, cables and editors do to it."""

import re
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

Rng: TypeAlias = np.random.Generator

WRITTEN = (
    *("0", "-1", "5", "3.0e-5", "-0.0", "1e308", "-1e308", "1e-308", "1e12", "1e-12", "1e"),
    *(".nan", ".inf", "-.inf", "nan", "99999999999999999999", "9223372036854775807", "017"),
    *("0x10", "1_000", "1,5", "4000000000", "true", "off", "null", "~", "", "word", "é", '"5.0"'),
    *('"\\u0000"', "[]", "{}", "[1.0]", "[[[[1.0]]]]", "*other", "&name 1.0", "!!int 5"),
)
"""What may come to stand where a value stood."""


def turned(content: bytes, rng: Rng, places: Sequence[int] | None = None) -> bytes:
    """Give one byte, of ``places`` if there are any, one of its other values."""
    at = int(rng.choice(len(content) if places is None else np.asarray(places)))
    changed = bytearray(content)
    changed[at] ^= int(rng.integers(1, 256))
    return bytes(changed)


def cut(content: bytes, rng: Rng) -> bytes:
    """Leave the beginning."""
    return content[: int(rng.integers(len(content)))]


def edited(content: bytes, rng: Rng) -> bytes:
    """Make one mistake of those that people and disks make in a text of keys and values."""
    edit = _EDITS[int(rng.integers(len(_EDITS)))]
    return edit(content, rng)


def _other_value(content: bytes, rng: Rng) -> bytes:
    written = WRITTEN[int(rng.integers(len(WRITTEN)))]
    return _replaced(content, rb"(?<=: )[^\s{\[#,}\]][^\s,}\]#]*", written.encode(), rng)


def _other_number(content: bytes, rng: Rng) -> bytes:
    written = WRITTEN[int(rng.integers(len(WRITTEN)))]
    return _replaced(content, rb"(?<![\w.])[-+]?\d+\.?\d*(?:e[-+]?\d+)?", written.encode(), rng)


def _other_digit(content: bytes, rng: Rng) -> bytes:
    return _replaced(content, rb"\d", b"%d" % rng.integers(10), rng)


def _replaced(content: bytes, pattern: bytes, written: bytes, rng: Rng) -> bytes:
    places = list(re.finditer(pattern, content))
    if not places:
        return turned(content, rng)
    found = places[int(rng.integers(len(places)))]
    return content[: found.start()] + written + content[found.end() :]


def _without_line(content: bytes, rng: Rng) -> bytes:
    lines = content.split(b"\n")
    del lines[int(rng.integers(len(lines)))]
    return b"\n".join(lines)


def _line_again(content: bytes, rng: Rng) -> bytes:
    lines = content.split(b"\n")
    here, there = rng.integers(len(lines), size=2)
    lines.insert(int(there), lines[int(here)])
    return b"\n".join(lines)


def _line_moved(content: bytes, rng: Rng) -> bytes:
    lines = content.split(b"\n")
    at = int(rng.integers(len(lines)))
    lines[at] = b" " * int(rng.integers(1, 4)) + lines[at]
    return b"\n".join(lines)


_EDITS: tuple[Callable[[bytes, Rng], bytes], ...] = (
    *(turned, cut, _other_value, _other_number, _other_digit),
    *(_without_line, _line_again, _line_moved),
)
