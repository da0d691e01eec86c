"""Writes channels of an image, one a file, as Gwyddion Simple Fields, by the package gsffile.

Values are of 32 bits. The first row is that of the highest y, and what is stated follows the fields
that the format defines.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import gsffile
import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.channels import ImageChannel, Signal

FORBIDDEN = ("=", "\n", "\r", "\0")
"""Characters that end a field's name or its value."""


def write(
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
    signals: Sequence[Signal],
) -> None:
    """Write the files; raises InputError for signals, and for words that a field cannot hold."""
    if signals:
        raise InputError(f"{targets[0]}: a .gsf file holds no signals: write them to .nc or .csv")
    for path, channel in zip(targets, channels, strict=True):
        _refuse(path, channel, stated)
    for path, channel in zip(targets, channels, strict=True):
        rows = np.ascontiguousarray(channel.values[::-1], dtype=np.float32)
        gsffile.write_gsf(path, rows, {**_fields(channel), **stated})


def _refuse(path: Path, channel: ImageChannel, stated: Mapping[str, str]) -> None:
    for name, value in {**_fields(channel), **stated}.items():
        if any(mark in f"{name}{value}" for mark in FORBIDDEN):
            raise InputError(f"{path}: {name} holds '=' or a line end: leave it out")
    if np.abs(channel.values).max() > np.finfo(np.float32).max:
        raise InputError(f"{path}: a value is too large for 32 bits: write .gwy or .nc")


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
