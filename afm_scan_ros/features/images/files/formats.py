"""Reads and writes an image in the format of the file's suffix."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files import arrays, gwyddion, instruments, nanosurf
from afm_scan_ros.features.images.files.channels import ImageChannel, chosen, image_of, paired
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.files.columns import Signal
from afm_scan_ros.files.paths import path_of

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
    ".npz": Format("archive of the arrays of an image", "numpy", arrays.read_npz),
}
"""Formats that are read, by suffix."""
WRITTEN = {
    ".gwy": Format("Gwyddion file", "gwyfile", gwyddion.write_gwy),
    ".gsf": Format("Gwyddion Simple Field", "gsffile", gwyddion.write_gsf),
    ".nc": Format("netCDF-4 file", "h5netcdf", arrays.write_netcdf),
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
