"""The elements of a MATLAB file: checked before scipy reads them, which trusts what they state."""

import math
import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from afm_scan_ros.files.arrays import refuse_unfolding

HEADER = 128
"""Bytes of text, version and byte order before the first element."""
TAG = 8
"""Bytes of a tag: type and size of an element."""
MATRIX, COMPRESSED = 14, 15
NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
"""Types of elements that hold numbers or characters."""
FLAGS, COMPLEX = 6, 0x800
"""Type of the array flags, and the bit among them by which an imaginary part follows."""
SPARSE, DATA = 5, range(1, 16)
"""Class of a sparse matrix, which states more elements than it holds, and classes of all data."""
PARTS = {4: 4, 5: 6} | dict.fromkeys(range(6, 16), 4)
"""Elements of a matrix by its class: characters, sparse, and numbers; an imaginary part is more."""
CHARACTERS, HOLDERS = 4, range(1, 4)
"""Class of text, and those whose elements are matrices: cells, structures and objects."""
LONGEST = 2**24
"""Characters of a text, each of which takes many bytes in memory."""
MOST_ELEMENTS = 10**6
"""Elements of a file, each of which takes hundreds of bytes in memory."""


def check_elements(path: Path) -> None:
    """Raise ValueError where an element of a level 5 file has no known type or does not fit.

    scipy trusts the tags of elements, and crashes. Source: The MathWorks, MAT-File Format,
    "Level 5 MAT-File Format".
    """
    content = path.read_bytes()
    order = "<" if content[126:HEADER] == b"IM" else ">"
    found = list(_elements(memoryview(content)[HEADER:], order, padded=False))
    refuse_unfolding(sum(_unfolded(*each, order) for each in found), len(content))
    left = MOST_ELEMENTS
    for kind, data in found:
        inner = [(kind, data)]
        if kind == COMPRESSED:
            inner = list(_elements(_inflated(data, order), order, padded=False))
        for each, matrix in inner:
            if each != MATRIX:
                raise ValueError(f"an element of type {each} stands where an array should")
            left = _check_matrix(matrix, order, left)


def _unfolded(kind: int, data: memoryview, order: str) -> int:
    """Return the bytes that an element states to hold once it is not compressed."""
    if kind != COMPRESSED:
        return len(data)
    tag = zlib.decompressobj().decompress(data, TAG)
    if len(tag) < TAG:
        raise ValueError("a compressed element has no tag")
    return TAG + int(struct.unpack_from(f"{order}I", tag, 4)[0])


def _inflated(data: memoryview, order: str) -> memoryview:
    """Return what a compressed element holds, which must be as long as it states."""
    size, inflating = _unfolded(COMPRESSED, data, order), zlib.decompressobj()
    held = inflating.decompress(data, size + 1)
    if len(held) > size or not inflating.eof:
        raise ValueError(f"a compressed element holds more than the {size} bytes that it states")
    return memoryview(held)


def _check_matrix(data: memoryview, order: str, left: int) -> int:
    """Check the elements of a matrix and of those in it; an empty one has none.

    Returns how many elements are ``left`` of those that the file may have.
    """
    parts = list(islice(_elements(data, order, padded=True), left + 1))
    left -= len(parts)
    if left < 0:
        raise ValueError(f"its arrays have more than {MOST_ELEMENTS} elements")
    if not parts:
        return left
    (kind, flags), *_ = parts
    if kind != FLAGS or len(flags) != 8:  # noqa: PLR2004 - two numbers of 4 bytes
        raise ValueError("an array begins without its flags")
    (word,) = struct.unpack_from(f"{order}I", flags)
    number = word & 0xFF
    if number in DATA and number != SPARSE and len(parts) > 1:
        held = len(parts) if number in HOLDERS else len(data)
        _check_size(parts[1][1], min(held, LONGEST) if number == CHARACTERS else held, order)
    needed = PARTS.get(number)
    if needed is not None and len(parts) != needed + bool(word & COMPLEX):
        raise ValueError(f"an array of class {number} has {len(parts)} elements")
    for kind, inner in parts:
        if kind == MATRIX and needed is None:
            left = _check_matrix(inner, order, left)
        elif kind not in NUMBERS:
            raise ValueError(f"an array holds an element of unknown type {kind}")
    return left


def _check_size(sizes: memoryview, held: int, order: str) -> None:
    """Check an array's sizes: scipy takes memory for what is stated, a byte or more an element."""
    stated = math.prod(struct.unpack(f"{order}{len(sizes) // 4}i", sizes[: len(sizes) // 4 * 4]))
    if not 0 <= stated <= held:
        raise ValueError(f"an array states {stated} elements, more than it holds")


def _elements(data: memoryview, order: str, *, padded: bool) -> Iterator[tuple[int, memoryview]]:
    """Yield type and data of each element; ``padded`` ones begin at multiples of 8 bytes."""
    at = 0
    while at < len(data):
        if len(data) - at < TAG:
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
