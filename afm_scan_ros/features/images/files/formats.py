"""Reads and writes an image in the format of the file's suffix."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import ImageChannel, chosen, image_of
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.files.columns import Signal
from afm_scan_ros.files.paths import path_of

HERE = "afm_scan_ros.features.images.files"
INSTALL = "pip install 'afm_scan_ros[images]'"


@frozen
class Format:
    """The module here that knows a format, what it is, and the package that it needs, if any."""

    module: str
    what: str
    package: str = ""

    def load(self, path: Path, verb: str) -> Any:  # noqa: ANN401 - each module has its functions
        """Import the module; raises InputError where its package cannot be imported."""
        try:
            return import_module(f"{HERE}.{self.module}")
        except ImportError as error:
            raise InputError(
                f"{path}: {self.package} is needed to {verb} a {self.what} and cannot be imported"
                f" ({error}): {INSTALL}"
            ) from error


FORMATS = {
    ".nid": Format("nid", "Nanosurf image", "NSFopen"),
    ".gwy": Format("gwy", "Gwyddion file", "gwyfile"),
    ".gsf": Format("gsf", "Gwyddion Simple Field", "gsffile"),
    ".spm": Format("spm", "Bruker Nanoscope image", "pySPM"),
    ".ibw": Format("ibw", "Asylum Research image", "igor2"),
    ".sxm": Format("sxm", "Nanonis image", "pySPM"),
    ".npz": Format("npz", "archive of the arrays of an image"),
}
"""Formats that are read, by suffix."""
WRITTEN = {
    ".gwy": FORMATS[".gwy"],
    ".gsf": FORMATS[".gsf"],
    ".nc": Format("netcdf", "netCDF-4 file", "h5netcdf"),
}
"""Formats that are written, by suffix."""
NOTHING: Mapping[str, str] = MappingProxyType({})


def read_image(path: str | Path, channel: str | None = None) -> ScanImage:
    """Read one channel of an image, trace and retrace as far as the file holds them.

    Arguments:
        path: a file of Nanosurf (``.nid``), Gwyddion (``.gwy``, ``.gsf``), Bruker (``.spm``),
            Asylum Research (``.ibw``) or Nanonis (``.sxm``), or an ``.npz`` file. The latter holds
            the arrays ``trace`` and ``retrace``, and ``range_x`` and ``range_y`` in m. It may hold
            the other fields of ``ScanImage``. All others need the extra ``images``.
        channel: its name in the file without its direction, as ``Topography``. By default the
            first channel of the height that has both directions.

    Row 0 has the lowest y and column 0 the lowest x, also in the retrace, for every format. What
    a file does not state is in the image's ``assumptions``, or None. Raises InputError, which
    names the file and the fix, for a file that is missing, damaged or of another format. So it does
    for a channel that is not there, and for a package that is not installed.
    """
    path = path_of(path, "grating.gwy")
    known = FORMATS.get(path.suffix.lower())
    if known is None:
        raise InputError(f"{path}: no format of images that is known: give {', '.join(FORMATS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file: give a file of an image")
    module = known.load(path, "read")
    try:
        return image_of(path, chosen(path, module.read(path), channel))
    except InputError:
        raise
    except Exception as error:  # the packages raise whatever a damaged file makes them run into
        raise InputError(
            f"{path}: no {known.what} that can be read, it is damaged or cut short: copy or save"
            " it again"
        ) from error


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
    module = known.load(path, "write")
    targets = _targets(path, channels)
    for number, target in enumerate(targets):
        if target in targets[:number]:
            raise InputError(f"{path}: two channels would be in {target.name}: rename one")
        if target.exists():
            raise InputError(f"{target} exists already: give another file or remove it")
    module.write(targets, channels, stated, signals)
    return targets


def _targets(path: Path, channels: Sequence[ImageChannel]) -> tuple[Path, ...]:
    """Return the files to be made: one, but for a format of one channel a file."""
    if path.suffix.lower() != ".gsf":
        return (path,)
    others = (f"{path.stem}_{_plain(each.title)}{path.suffix}" for each in channels[1:])
    return (path, *(path.with_name(name) for name in others))


def _plain(title: str) -> str:
    """Return a title as part of the name of a file: ``Error x (trace)`` is ``error_x_trace``."""
    words = "".join(c if c.isalnum() else " " for c in title.lower()).split()
    return "_".join(words)
