"""Which files a bag is made of, and what is missing from it."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from attrs import frozen

from afm_scan_ros.bag.mcap_file import is_mcap, is_whole
from afm_scan_ros.bag.metadata import NAME, read_metadata
from afm_scan_ros.core.errors import InputError


@frozen
class BagFiles:
    """The files of a bag in order, and a sentence for each thing that is missing."""

    files: tuple[Path, ...]
    warnings: tuple[str, ...]


def bag_files(path: Path) -> BagFiles:
    """Find the files of a rosbag2 folder or a single ``.mcap``.

    Raises InputError where there are none, or they are not MCAP.
    """
    if path.is_dir():
        files, warnings = _files_of_folder(path)
    elif path.is_file():
        files, warnings = (path,), ()
    else:
        raise InputError(f"{path} does not exist: give a rosbag2 folder or an .mcap file")
    for file in files:
        if not is_mcap(file):
            raise InputError(f"{file} is not an MCAP file: record with 'ros2 bag record -s mcap'")
    return BagFiles(files, warnings + tuple(_cut(path, f) for f in files if not is_whole(f)))


def _files_of_folder(folder: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    files = tuple(sorted(folder.glob("*.mcap"), key=_by_number))
    if (folder / NAME).is_file():
        listed = _listed(folder)
        unlisted = [file for file in files if file not in listed]
        return listed, tuple(f"{f} is not read: {folder / NAME} does not list it" for f in unlisted)
    if not files:
        raise InputError(f"{folder} holds neither {NAME} nor .mcap files: give a rosbag2 folder")
    warning = (
        f"{folder} has no {NAME}: the recorder did not finish;"
        f" 'ros2 bag reindex {folder} -s mcap' writes it"
    )
    return files, (warning,)


def _listed(folder: Path) -> tuple[Path, ...]:
    metadata = _read(folder)
    storage = metadata.get("storage_identifier", "mcap")
    compression = metadata.get("compression_mode", "")
    if storage != "mcap" or compression:
        raise InputError(
            f"{folder} is stored as {storage} {compression}".rstrip()
            + ": convert it to plain mcap with 'ros2 bag convert'"
        )
    names = metadata["relative_file_paths"]
    for name in names:
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise InputError(f"{folder / NAME} names {name}, which is not in the bag's folder")
        if not (folder / name).is_file():
            raise InputError(f"{folder / NAME} names {name}, which is missing: bring it back")
    return tuple(folder / name for name in names)


def _read(folder: Path) -> Mapping[str, Any]:
    try:
        return read_metadata(folder / NAME)
    except InputError as error:
        mend = f"remove it and run 'ros2 bag reindex {folder} -s mcap'"
        raise InputError(f"{error}: not a rosbag2 metadata file: {mend}") from error


def _by_number(path: Path) -> tuple[int, str]:
    """Order of split files: NAME_10 after NAME_9."""
    number = re.search(r"(\d+)$", path.stem)
    return int(number[1]) if number else 0, path.name


def _cut(bag: Path, file: Path) -> str:
    return (
        f"{file} was cut short: what its recorder had not finished writing is missing;"
        f" 'ros2 bag reindex {bag if bag.is_dir() else bag.parent} -s mcap' repairs its index"
    )
