"""Whether a MATLAB file of level 5 is built by its format: scipy trusts its tags, and crashes.

Source: The MathWorks, MAT-File Format, "Level 5 MAT-File Format".
"""

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

HEADER = 128
"""Bytes of text, version and byte order before the first element."""
MATRIX, COMPRESSED = 14, 15
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
"""Types of elements that hold numbers or characters."""
FLAGS, COMPLEX = 6, 0x800
"""Type of the array flags, and the bit among them by which an imaginary part follows."""
SPARSE, DATA = 5, range(1, 16)
"""Class of a sparse matrix, which states more elements than it holds, and classes of all data."""
PARTS = {4: 4, 5: 6} | dict.fromkeys(range(6, 16), 4)
"""Elements of a matrix by its class: characters, sparse, and numbers; an imaginary part is more."""


def check_elements(path: Path) -> None:
    """Raise ValueError where an element of a level 5 file has no known type or does not fit."""
    content = path.read_bytes()
    order = "<" if content[126:HEADER] == b"IM" else ">"
    for kind, data in _elements(memoryview(content)[HEADER:], order, padded=False):
        found = [(kind, data)]
        if kind == COMPRESSED:
            found = list(_elements(memoryview(zlib.decompress(data)), order, padded=False))
        for each, matrix in found:
            if each != MATRIX:
                raise ValueError(f"an element of type {each} stands where an array should")
            _check_matrix(matrix, order)


def _check_matrix(data: memoryview, order: str) -> None:
    """Check the elements of a matrix and of those in it; an empty one has none."""
    parts = list(_elements(data, order, padded=True))
    if not parts:
        return
    (kind, flags), *_ = parts
    if kind != FLAGS or len(flags) != 8:  # noqa: PLR2004 - two numbers of 4 bytes
        raise ValueError("an array begins without its flags")
    (word,) = struct.unpack_from(f"{order}I", flags)
    if word & 0xFF in DATA and word & 0xFF != SPARSE and len(parts) > 1:
        _check_size(parts[1][1], len(data), order)
    needed = PARTS.get(word & 0xFF)
    if needed is not None and len(parts) != needed + bool(word & COMPLEX):
        raise ValueError(f"an array of class {word & 0xFF} has {len(parts)} elements")
    for kind, inner in parts:
        if kind == MATRIX and needed is None:
            _check_matrix(inner, order)
        elif kind not in NUMBERS:
            raise ValueError(f"an array holds an element of unknown type {kind}")


def _check_size(sizes: memoryview, held: int, order: str) -> None:
    """Check an array's sizes: scipy takes memory for what is stated, a byte or more an element."""
    stated = math.prod(struct.unpack(f"{order}{len(sizes) // 4}i", sizes[: len(sizes) // 4 * 4]))
    if not 0 <= stated <= held:
        raise ValueError(f"an array states {stated} elements, more than it holds")


def _elements(data: memoryview, order: str, *, padded: bool) -> Iterator[tuple[int, memoryview]]:
    """Yield type and data of each element; ``padded`` ones begin at multiples of 8 bytes."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:  # noqa: PLR2004 - a tag's bytes
            raise ValueError(f"ends within a tag, after {len(data) - at} bytes of it")
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start, after = at + 8, at + 8 + size
        if kind >> 16:  # a small element: size, type and up to 4 bytes of data in place of a tag
            kind, size = kind & 0xFFFF, kind >> 16
            start, after = at + 4, at + 8
        if start + size > min(after, len(data)):
            raise ValueError(f"an element states {size} bytes, more than follow")
        yield kind, data[start : start + size]
        at = after + (-size % 8 if padded and start == at + 8 else 0)
