"""Images as arrays by their names: ``.npz``, which is read, and netCDF-4, ``.nc``, written.

An ``.npz`` file holds ``trace`` and the other fields of ``ScanImage``. ``trace`` and ``retrace``
are of shape (lines, pixels), row 0 at the lowest y and column 0 at the lowest x. ``range_x``,
``range_y`` (m), ``line_time`` (s), ``upward``, ``overscan``, ``channel`` and ``unit`` are single
values. All but ``trace`` and the ranges may be left out.

netCDF-4 is written by h5netcdf, for xarray and readers of HDF5. Each channel is a variable over
``y`` and ``x``, which hold the middles of the pixels in m and rise. Each signal is a variable over
``sample``. Attributes follow the CF conventions: ``units`` and ``long_name``. What is stated are
the file's attributes.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import Direction, ImageChannel, ScanFacts
from afm_scan_ros.files.arrays import open_archive, read_member
from afm_scan_ros.files.columns import Signal
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.files.records import refuse_unknown

NEEDED = ("trace", "range_x", "range_y")
FURTHER = ("retrace", "line_time", "upward", "overscan", "channel", "unit")
NUMBERS = ("range_x", "range_y", "line_time", "overscan")
CONVENTIONS = "CF-1.11"
SAMPLE = "sample"

Axis = tuple[str, int, float, float]
"""Letter, number of pixels, and start and extent in m."""


def read_npz(_: ModuleType, path: Path) -> Iterator[Direction]:
    """Read the only channel; raises InputError for a name that is missing or unknown."""
    with open_archive(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        refuse_unknown(names, NEEDED + FURTHER, "its arrays")
        for name in NEEDED:
            if name not in names:
                raise InputError(f"no array '{name}': add it")
        values = {name: read_member(archive, f"{name}.npy") for name in names}
    channel, unit = (
        str(values[name].item()) if name in values else default
        for name, default in (("channel", "Topography"), ("unit", "m"))
    )
    numbers = {name: _number(values, name) for name in NUMBERS if name in values}
    upward = bool(_number(values, "upward")) if "upward" in values else None
    facts = ScanFacts(**numbers, upward=upward)
    for side in ("trace", "retrace"):
        if side in values:
            yield Direction(channel, side == "retrace", unit, facts, _numbers(values, side))


def _number(values: Mapping[str, NDArray[Any]], name: str) -> float:
    if values[name].size != 1:
        raise InputError(f"{name} has shape {values[name].shape}: give one number")
    return float(_numbers(values, name).item())


def _numbers(values: Mapping[str, NDArray[Any]], name: str) -> NDArray[np.float64]:
    if values[name].dtype.kind not in "biuf":
        raise InputError(f"{name} holds {values[name].dtype}: give real numbers")
    return np.asarray(values[name], dtype=np.float64)


def write_netcdf(
    h5netcdf: ModuleType,
    targets: Sequence[Path],
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str],
    signals: Sequence[Signal] = (),
) -> None:
    """Write the file; raises InputError for names that differ in their punctuation alone."""
    (path,) = targets
    titles = [re.sub(r"\W+", "_", channel.title.lower()).strip("_") for channel in channels]
    names = titles + [each.name for each in signals]
    for name in names:
        if names.count(name) > 1 or name in ("x", "y"):
            raise InputError(f"{path}: two variables would be named '{name}': rename a channel")
    with replacing(path) as beside, h5netcdf.File(beside, "w") as file:
        file.attrs.update({"Conventions": CONVENTIONS, **stated})
        axes: dict[Axis, str] = {}
        for name, channel in zip(titles, channels, strict=True):
            lines, pixels = channel.values.shape
            over = (
                _axis(file, axes, ("y", lines, channel.bottom, channel.range_y)),
                _axis(file, axes, ("x", pixels, channel.left, channel.range_x)),
            )
            values = np.asarray(channel.values, dtype=np.float64)
            variable = file.create_variable(name, over, data=values)
            variable.attrs.update(units=channel.unit, long_name=channel.title)
        for signal in signals:
            if SAMPLE not in file.dimensions:
                file.dimensions[SAMPLE] = len(signal.values)
            variable = file.create_variable(signal.name, (SAMPLE,), data=signal.values)
            variable.attrs.update(units=signal.unit, long_name=signal.name.replace("_", " "))


def _axis(file: Any, axes: dict[Axis, str], axis: Axis) -> str:  # noqa: ANN401 - not typed
    """Return the name of an axis, written once; others than the first of a letter are numbered."""
    if axis not in axes:
        letter, count, start, extent = axis
        number = 1 + sum(known == letter for known, *_ in axes)
        name = axes[axis] = letter if number == 1 else f"{letter}{number}"
        file.dimensions[name] = count
        middles = start + extent * (np.arange(count) + 0.5) / count
        variable = file.create_variable(name, (name,), data=middles)
        variable.attrs.update(units="m", long_name=f"position in {letter}")
    return axes[axis]
