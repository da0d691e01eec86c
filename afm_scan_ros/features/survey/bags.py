"""Bags in folders: which there are, whether they are complete, and whose instrument made them."""

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from re import Pattern

from attrs import frozen

from afm_scan_ros.bag.folder import NAME, read_metadata
from afm_scan_ros.bag.mcap_file import is_mcap, is_whole
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.yaml import read_text

INSTRUMENT = "instrument"
"""Key of ``custom_data`` in ``metadata.yaml``, as 'ros2 bag record --custom-data' writes it."""


@frozen(order=True)
class FoundBag:
    """A bag, a ``name`` of its path, and a digest of names, sizes and times of its files.

    It is ``complete`` where its recorder has finished it.
    """

    path: Path
    name: str
    identity: str
    complete: bool

    @classmethod
    def at(cls, path: Path) -> "FoundBag":
        """Describe the bag at a path."""
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        known = [(file.name, file.stat()) for file in files]
        texts = (f"{name} {of.st_size} {of.st_mtime_ns}" for name, of in known)
        finished = (path / NAME).is_file() if path.is_dir() else is_mcap(path) and is_whole(path)
        return cls(path, _digest(str(path.resolve())), _digest("\n".join(texts)), finished)


def found_bags(paths: Iterable[Path]) -> list[FoundBag]:
    """Find bags: each path is an ``.mcap`` file, a bag's folder, or a folder with bags below it.

    A bag whose files are being renamed or removed at the moment is left out. Raises InputError for
    a path that does not exist, and for a file of another kind.
    """
    places: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} does not exist: give bags, or folders that hold bags")
        if path.is_file() and path.suffix != ".mcap":
            raise InputError(f"{path} is no bag: give a rosbag2 folder or an .mcap file")
        places |= dict.fromkeys(_below(path))
    found = []
    for path in places:
        with suppress(FileNotFoundError):
            found.append(FoundBag.at(path))
    return found


def instrument_of(bag: Path, rule: Pattern[str] | None = None) -> str:
    """Name of a bag's instrument: by a rule, else as ``metadata.yaml`` states it, else its folder.

    A rule is sought in the absolute path, and its first group is the name. Raises InputError where
    it is not found. The folder is the one that the bag lies in.
    """
    path = bag.absolute()
    if rule is not None:
        found = rule.search(path.as_posix())
        if found is None:
            raise InputError(f"{path}: the rule '{rule.pattern}' is not found in this path")
        return found[1]
    with suppress(InputError, OSError):
        if INSTRUMENT in read_text(path / NAME):  # parsing takes milliseconds
            stated = read_metadata(path / NAME).get("custom_data") or {}
            if isinstance(stated, dict) and INSTRUMENT in stated:
                return str(stated[INSTRUMENT])
    return path.parent.name


def _below(path: Path) -> Iterator[Path]:
    if path.is_file() or (path / NAME).is_file() or any(path.glob("*.mcap")):
        yield path
        return
    for each in sorted(path.iterdir()):
        if each.is_dir():
            yield from _below(each)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
