"""Writes channels and signals as netCDF-4, ``.nc``, by h5netcdf, for xarray and readers of HDF5.

Each channel is a variable over ``y`` and ``x``, which hold the middles of the pixels in m and rise.
Each signal is a variable over ``sample``. Attributes follow the CF conventions: ``units`` and
``long_name``. What is stated are the file's attributes.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import h5netcdf
import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import ImageChannel
from afm_scan_ros.files.columns import Signal
from afm_scan_ros.files.paths import replacing

CONVENTIONS = "CF-1.11"
SAMPLE = "sample"


def write(
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
    signals: Sequence[Signal],
) -> None:
    """Write the file; raises InputError for names that differ in their punctuation alone."""
    (path,) = targets
    names = [_variable(channel.title) for channel in channels] + [each.name for each in signals]
    for name in names:
        if names.count(name) > 1 or name in ("x", "y"):
            raise InputError(f"{path}: two variables would be named '{name}': rename a channel")
    with replacing(path) as beside, h5netcdf.File(beside, "w") as file:
        file.attrs.update({"Conventions": CONVENTIONS, **stated})
        axes = _Axes(file)
        for channel in channels:
            values = np.asarray(channel.values, dtype=np.float64)
            variable = file.create_variable(_variable(channel.title), axes.of(channel), data=values)
            variable.attrs.update(units=channel.unit, long_name=channel.title)
        for signal in signals:
            if SAMPLE not in file.dimensions:
                file.dimensions[SAMPLE] = len(signal.values)
            variable = file.create_variable(signal.name, (SAMPLE,), data=signal.values)
            variable.attrs.update(units=signal.unit, long_name=signal.name.replace("_", " "))


def _variable(title: str) -> str:
    return re.sub(r"\W+", "_", title.lower()).strip("_")


class _Axes:
    """The coordinates of channels; those of another size or place than the first are numbered."""

    def __init__(self, file: h5netcdf.File) -> None:
        self._file = file
        self._names: dict[tuple[str, int, float, float], str] = {}

    def of(self, channel: ImageChannel) -> tuple[str, str]:
        """Return the names of y and x, after they were written."""
        lines, pixels = channel.values.shape
        return (
            self._axis("y", lines, channel.bottom, channel.range_y),
            self._axis("x", pixels, channel.left, channel.range_x),
        )

    def _axis(self, letter: str, count: int, start: float, extent: float) -> str:
        key = letter, count, start, extent
        if key not in self._names:
            number = 1 + sum(known == letter for known, *_ in self._names)
            name = letter if number == 1 else f"{letter}{number}"
            self._file.dimensions[name] = count
            middles = start + extent * (np.arange(count) + 0.5) / count
            variable = self._file.create_variable(name, (name,), data=middles)
            variable.attrs.update(units="m", long_name=f"position in {letter}")
            self._names[key] = name
        return self._names[key]
