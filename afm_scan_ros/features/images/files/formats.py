"""Reads and writes an image in the format of the file's suffix.

Of arrays by their names are ``.npz``, which is read, and netCDF-4, ``.nc``, written.

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
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files import gwyddion, instruments, nanosurf
from afm_scan_ros.features.images.files.channels import (
    Direction,
    ImageChannel,
    ScanFacts,
    chosen,
    image_of,
    paired,
)
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.files.arrays import open_archive, read_member
from afm_scan_ros.files.columns import Signal
from afm_scan_ros.files.paths import path_of, replacing
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


INSTALL = "pip install 'afm_scan_ros[images]'"
NOTHING: Mapping[str, str] = MappingProxyType({})


@frozen
class Format:
    """What a format is, the module that is needed, and what reads or writes it with that module.

    Readers take the module and a path, and return each ``Direction``. Writers take the module,
    paths, channels, words and signals. Both raise InputError for what the format cannot hold.
    """

    what: str
    needed: str
    run: Callable[..., Any]

    def load(self, path: Path, verb: str) -> ModuleType:
        """Import the module; raises InputError where it cannot be imported."""
        try:
            return import_module(self.needed)
        except ImportError as error:
            raise InputError(
                f"{path}: {self.needed.partition('.')[0]} is needed to {verb} a {self.what} and"
                f" cannot be imported ({error}): {INSTALL}"
            ) from error


FORMATS = {
    ".nid": Format("Nanosurf image", "NSFopen.read", nanosurf.read),
    ".gwy": Format("Gwyddion file", "numpy", gwyddion.read_gwy),
    ".gsf": Format("Gwyddion Simple Field", "gsffile", gwyddion.read_gsf),
    ".spm": Format("Bruker Nanoscope image", "pySPM", instruments.read_spm),
    ".ibw": Format("Asylum Research image", "igor2.binarywave", instruments.read_ibw),
    ".sxm": Format("Nanonis image", "pySPM", instruments.read_sxm),
    ".npz": Format("archive of the arrays of an image", "numpy", read_npz),
}
"""Formats that are read, by suffix."""
WRITTEN = {
    ".gwy": Format("Gwyddion file", "gwyfile", gwyddion.write_gwy),
    ".gsf": Format("Gwyddion Simple Field", "gsffile", gwyddion.write_gsf),
    ".nc": Format("netCDF-4 file", "h5netcdf", write_netcdf),
}
"""Formats that are written, by suffix."""


def read_image(path: str | Path, channel: str | None = None) -> ScanImage:
    """Read one channel of an image, trace and retrace as far as the file holds them.

    Parameters
    ----------
    path
        A file of Nanosurf (``.nid``), Gwyddion (``.gwy``, ``.gsf``), Bruker (``.spm``), Asylum
        Research (``.ibw``) or Nanonis (``.sxm``), or an ``.npz`` file. The latter holds the arrays
        ``trace`` and ``retrace``, and ``range_x`` and ``range_y`` in m; it may hold the other
        fields of ``ScanImage``. All but ``.gwy`` and ``.npz`` need the extra ``images``.
    channel
        Its name in the file without its direction, as ``Topography``. By default the first channel
        of the height that has both directions.

    Returns
    -------
    ScanImage
        Row 0 has the lowest y and column 0 the lowest x, also in the retrace, for every format.
        What a file does not state is in the image's ``assumptions``, or None.

    Raises
    ------
    InputError
        For a file that is missing, damaged or of another format, for a channel that is not there,
        and for a package that is not installed; it names the file and the fix.
    """
    path = path_of(path, "grating.gwy")
    known = FORMATS.get(path.suffix.lower())
    if known is None:
        raise InputError(f"{path}: no format of images that is known: give {', '.join(FORMATS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file: give a file of an image")
    module = known.load(path, "read")
    try:
        sides = chosen(paired(known.run(module, path)), channel)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error.__cause__
    except Exception as error:  # the packages raise whatever a damaged file makes them run into
        raise InputError(
            f"{path}: no {known.what} that can be read, it is damaged or cut short: copy or save"
            " it again"
        ) from error
    return image_of(path, sides)


def write_image(
    path: str | Path,
    channels: Sequence[ImageChannel],
    stated: Mapping[str, str] = NOTHING,
    signals: Sequence[Signal] = (),
) -> tuple[Path, ...]:
    """Write channels and what is stated of them, and return the files that were made.

    Arguments:
        path: a file of the suffix ``.gwy``, ``.gsf`` or ``.nc``. A ``.gsf`` file holds one channel:
            the first is in ``path``, each other in ``STEM_TITLE.gsf`` beside it.
        channels: at least one.
        stated: words on the image by their names, as its provenance. ``words_of`` an image are
            those that ``read_image`` takes its time, direction and overscan from.
        signals: samples against time, for ``.nc`` alone, where ``time`` is one of them.

    Raises InputError naming the file and the fix, for an unknown suffix and a file that is there
    already. So it does for a package that is not installed, and for what the format cannot hold.
    """
    path = Path(path)
    known = WRITTEN.get(path.suffix.lower())
    if known is None:
        raise InputError(f"{path}: no format of images to write: give {', '.join(WRITTEN)}")
    if not channels and not signals:
        raise InputError(f"{path}: nothing to write: give at least one channel")
    if signals and path.suffix.lower() != ".nc":
        raise InputError(f"{path}: a {known.what} holds no signals: write them to .nc or .csv")
    module = known.load(path, "write")
    targets = _targets(path, channels)
    for number, target in enumerate(targets):
        if target in targets[:number]:
            raise InputError(f"{path}: two channels would be in {target.name}: rename one")
        if target.exists():
            raise InputError(f"{target} exists already: give another file or remove it")
    known.run(module, targets, channels, stated, *([signals] if signals else []))
    return targets


def _targets(path: Path, channels: Sequence[ImageChannel]) -> tuple[Path, ...]:
    """Return the files to be made: one, but for a format of one channel a file."""
    if path.suffix.lower() != ".gsf":
        return (path,)
    words = ("".join(c if c.isalnum() else " " for c in each.title.lower()) for each in channels)
    others = [f"{path.stem}_{'_'.join(title.split())}{path.suffix}" for title in words]
    return (path, *(path.with_name(name) for name in others[1:]))
