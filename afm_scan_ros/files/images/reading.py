"""Reads an image of any format that is known, whatever program saved it."""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from textwrap import shorten
from typing import cast

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.files.images.found import FoundChannel, chosen, image_of

HERE = "afm_scan_ros.files.images"
MOST_SAID = 100
"""Characters of a package's own message that are shown."""
INSTALL = "pip install 'afm-scan-ros[images]'"


@frozen
class Format:
    """The module here that reads a format, what it is, and the package that it needs, if any."""

    module: str
    what: str
    package: str = ""


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

Reader = Callable[[Path], Sequence[FoundChannel]]


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
    path = Path(path)
    known = FORMATS.get(path.suffix.lower())
    if known is None:
        raise InputError(f"{path}: no format of images that is known: give {', '.join(FORMATS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file: give a file of an image")
    read = _reader(path, known)
    try:
        found = read(path)
        return image_of(path, chosen(path, found, channel))
    except InputError:
        raise
    except Exception as error:  # the packages raise whatever a damaged file makes them run into
        said = shorten(str(error), MOST_SAID) or type(error).__name__
        raise InputError(
            f"{path}: no {known.what} that can be read, it is damaged or cut short ({said}): save"
            " it again"
        ) from error


def _reader(path: Path, known: Format) -> Reader:
    try:
        module = import_module(f"{HERE}.{known.module}")
    except ImportError as error:
        raise InputError(
            f"{path}: {known.package} is needed to read a {known.what} and cannot be imported"
            f" ({error}): {INSTALL}"
        ) from error
    return cast("Reader", module.read)
