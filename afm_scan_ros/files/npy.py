"""The header of a ``.npy`` array, checked before memory is taken for what it states."""

import math
from typing import BinaryIO

from numpy.lib import format as npy

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def check_header(stream: BinaryIO, size: int) -> None:
    """Read the header of an array of numbers in ``size`` bytes, and go back to its beginning.

    Raises ValueError where it is none, where it holds objects, which are never unpickled, and
    where it states another size than that of what follows.
    """
    version = npy.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"version {version} of the format is not for numbers")
    try:
        shape, _, kind = _HEADERS[version](stream)
    except Exception as error:  # numpy raises whatever its reading of the words runs into
        raise ValueError(f"its header cannot be read: {error}") from error
    if kind.hasobject:
        raise ValueError("holds objects, not numbers")
    stated, left = math.prod(shape) * kind.itemsize, size - stream.tell()
    if stated != left or min(shape, default=0) < 0:
        raise ValueError(f"states {kind} of shape {shape}, {stated} bytes, where {left} follow")
    stream.seek(0)
