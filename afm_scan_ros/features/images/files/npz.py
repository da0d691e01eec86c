"""Images as arrays, ``.npz``: ``trace`` and the other fields of ``ScanImage``, by their names.

``trace`` and ``retrace`` are of shape (lines, pixels), row 0 at the lowest y and column 0 at the
lowest x. ``range_x``, ``range_y`` (m), ``line_time`` (s), ``upward``, ``overscan``, ``channel`` and
``unit`` are single values. All but ``trace`` and the ranges may be left out.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import FoundChannel, ScanFacts, in_si
from afm_scan_ros.files.arrays import open_archive, read_member
from afm_scan_ros.files.records import refuse_unknown

NEEDED = ("trace", "range_x", "range_y")
FURTHER = ("retrace", "line_time", "upward", "overscan", "channel", "unit")


def read(path: Path) -> Sequence[FoundChannel]:
    """Read the only channel; raises InputError for a name that is missing or unknown."""
    with open_archive(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        refuse_unknown(names, NEEDED + FURTHER, str(path))
        for name in NEEDED:
            if name not in names:
                raise InputError(f"{path}: no array '{name}': add it")
        values = {name: read_member(archive, f"{name}.npy") for name in names}
    unit = _text(values, "unit", "m")
    trace, retrace = (
        in_si(_numbers(path, each, values[each]), unit)[0] if each in values else None
        for each in ("trace", "retrace")
    )
    channel = _text(values, "channel", "Topography")
    return [
        FoundChannel(channel, in_si(np.zeros(0), unit)[1], _facts(path, values), trace, retrace)
    ]


def _facts(path: Path, values: Mapping[str, NDArray[Any]]) -> ScanFacts:
    def number(name: str) -> float | None:
        return _number(path, name, values[name]) if name in values else None

    upward = number("upward")
    return ScanFacts(
        _number(path, "range_x", values["range_x"]),
        _number(path, "range_y", values["range_y"]),
        number("line_time"),
        None if upward is None else bool(upward),
        number("overscan"),
    )


def _text(values: Mapping[str, NDArray[Any]], name: str, default: str) -> str:
    return str(values[name].item()) if name in values else default


def _number(path: Path, name: str, array: NDArray[Any]) -> float:
    if array.size != 1:
        raise InputError(f"{path}: {name} has shape {array.shape}: give one number")
    return float(_numbers(path, name, array).item())


def _numbers(path: Path, name: str, array: NDArray[Any]) -> NDArray[np.float64]:
    if array.dtype.kind not in "biuf":
        raise InputError(f"{path}: {name} holds {array.dtype}: give real numbers")
    return np.asarray(array, dtype=np.float64)
