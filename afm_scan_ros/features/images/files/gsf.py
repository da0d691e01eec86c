"""Images of the Gwyddion Simple Field format, ``.gsf``, read and written by the package gsffile.

A file holds one channel in one direction, of 32 bits. Gwyddion's manual, "Gwyddion Simple Field",
states that data are stored by rows from top to bottom, each from left to right. The format states
neither line time nor direction. Files of this package state both as further fields.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import gsffile
import numpy as np

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

RANGES = ("XReal", "YReal")
FORBIDDEN = ("=", "\n", "\r", "\0")
"""Characters that end a field's name or its value."""


def read(path: Path) -> Sequence[FoundChannel]:
    """Read the only channel; raises InputError where its ranges are not stated."""
    values, stated = gsffile.read_gsf(path)
    for key in RANGES:
        if key not in stated:
            raise InputError(f"{path}: states no {key}: save it with its ranges in m")
    range_x, range_y = (metres(path, k, stated[k], stated.get("XYUnits", "")) for k in RANGES)
    numbers, unit = in_si(np.asarray(values, dtype=float)[::-1], stated.get("ZUnits", ""))
    facts = facts_of(path, ScanFacts(range_x, range_y), stated)
    return paired([Direction(stated.get("Title", "Channel"), unit, facts, numbers)])


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
        with replacing(path) as beside:
            gsffile.write_gsf(beside, rows, {**_fields(channel), **stated})


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
