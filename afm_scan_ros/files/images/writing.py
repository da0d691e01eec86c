"""Writes channels of an image for other programs, in the format of the file's suffix."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.channels import ImageChannel, Signal
from afm_scan_ros.files.images.reading import HERE, INSTALL, Format

WRITTEN = {
    ".gwy": Format("gwy_writer", "Gwyddion file", "gwyfile"),
    ".gsf": Format("gsf_writer", "Gwyddion Simple Field", "gsffile"),
    ".nc": Format("netcdf", "netCDF-4 file", "h5netcdf"),
}
"""Formats that are written, by suffix."""
NOTHING: Mapping[str, str] = MappingProxyType({})


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
    known = format_of(path)
    if not channels and not signals:
        raise InputError(f"{path}: nothing to write: give at least one channel")
    try:
        module = import_module(f"{HERE}.{known.module}")
    except ImportError as error:
        raise InputError(
            f"{path}: {known.package} is needed to write a {known.what} and cannot be imported"
            f" ({error}): {INSTALL}"
        ) from error
    targets = targets_of(path, channels)
    for number, target in enumerate(targets):
        if target in targets[:number]:
            raise InputError(f"{path}: two channels would be in {target.name}: rename one")
        if target.exists():
            raise InputError(f"{target} exists already: give another file or remove it")
    path.parent.mkdir(parents=True, exist_ok=True)
    module.write(targets, channels, stated, signals)
    return targets


def format_of(path: Path) -> Format:
    """Return the format of a file to be written; raises InputError for an unknown suffix."""
    known = WRITTEN.get(path.suffix.lower())
    if known is None:
        raise InputError(f"{path}: no format of images to write: give {', '.join(WRITTEN)}")
    return known


def targets_of(path: Path, channels: Sequence[ImageChannel]) -> tuple[Path, ...]:
    """Return the files to be made: one, but for a format of one channel a file."""
    if path.suffix.lower() != ".gsf":
        return (path,)
    others = (f"{path.stem}_{_plain(each.title)}{path.suffix}" for each in channels[1:])
    return (path, *(path.with_name(name) for name in others))


def _plain(title: str) -> str:
    """Return a title as part of the name of a file: ``Error x (trace)`` is ``error_x_trace``."""
    words = "".join(c if c.isalnum() else " " for c in title.lower()).split()
    return "_".join(words)
