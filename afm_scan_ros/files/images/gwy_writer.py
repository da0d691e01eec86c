"""Writes all channels of an image to one file of Gwyddion, ``.gwy``, by the package gwyfile.

The first row is that of the highest y, and what is stated lies in the metadata of each channel.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from gwyfile.objects import GwyContainer, GwyDataField

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.channels import ImageChannel, Signal

TEXT = "s"
"""Code of gwyfile for text, which it would take for a single character where it has one."""


def write(
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
    signals: Sequence[Signal],
) -> None:
    """Write the file; raises InputError for signals, and for words with a zero byte."""
    (path,) = targets
    if signals:
        raise InputError(f"{path}: a Gwyddion file holds no signals: write them to .nc or .csv")
    for words in (*stated.items(), *((each.name, each.unit) for each in channels)):
        if "\0" in "".join(words):
            raise InputError(f"{path}: '{words[0]}' holds a zero byte: leave it out")
    container = GwyContainer()
    for number, channel in enumerate(channels):
        container[f"/{number}/data"] = _field(channel)
        container[f"/{number}/data/title"] = channel.title
        container.typecodes[f"/{number}/data/title"] = TEXT
        container[f"/{number}/meta"] = GwyContainer(dict(stated), dict.fromkeys(stated, TEXT))
    container.tofile(str(path))


def _field(channel: ImageChannel) -> GwyDataField:
    return GwyDataField(
        np.ascontiguousarray(channel.values[::-1], dtype=np.float64),
        xreal=channel.range_x,
        yreal=channel.range_y,
        xoff=channel.left,
        yoff=channel.bottom,
        si_unit_xy="m",
        si_unit_z=channel.unit,
    )
