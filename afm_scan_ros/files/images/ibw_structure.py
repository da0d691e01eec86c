"""Whether a wave of Igor Pro holds together: igor2 takes any memory for sizes that are damaged.

The headers are those of version 5, the only one with several dimensions: Technical Note 3 of
WaveMetrics, "Igor Binary Format".
"""

import math
import struct

VERSION = 5
LENGTHS = "hhi14i"
"""Version, checksum and lengths of the parts: header with samples, formula, note, units, labels."""
RESERVED = 2
"""Numbers at the end of these that are no lengths."""
FILE_HEADER, WAVE_HEADER = 64, 320
SAMPLES, DIMENSIONS = FILE_HEADER + 12, FILE_HEADER + 68
"""Where the number of samples stands, and that along each dimension."""


def check_structure(content: bytes) -> None:
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
