"""Which files a bag is made of, what is missing, what sizes are possible, and ``metadata.yaml``."""

import re
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from attrs import define, frozen
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from afm_scan_ros.bag.mcap_file import HEAD, is_mcap, is_whole
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.arrays import FREE, refuse_unfolding
from afm_scan_ros.files.yaml import load

VERSION = 9
NAME = "metadata.yaml"

_NO_TIME = {"sec": 0, "nsec": 0}


@frozen
class BagTopic:
    """A topic of a bag; ``latched`` ones replay to readers that come late."""

    name: str
    type_name: str
    type_hash: str
    latched: bool


@define
class Contents:
    """What a bag, or a file of it, holds so far; times in ns."""

    counts: dict[str, int]
    start: int = 0
    end: int = 0

    def add(self, topic: str, stamp: int) -> None:
        """Count one message."""
        self.start = min(self.start, stamp) if any(self.counts.values()) else stamp
        self.end = max(self.end, stamp)
        self.counts[topic] += 1

    def extent(self) -> dict[str, Any]:
        """Return the times and the number of messages, as ``metadata.yaml`` has them."""
        return {
            "starting_time": {"nanoseconds_since_epoch": self.start},
            "duration": {"nanoseconds": self.end - self.start},
            "message_count": sum(self.counts.values()),
        }


def offered_qos(*, latched: bool) -> list[dict[str, Any]]:
    """Quality of service under which a topic was published, as ROS 2 bags write it."""
    return [
        {
            "history": "keep_last" if latched else "keep_all",
            "depth": 1 if latched else 0,
            "reliability": "reliable",
            "durability": "transient_local" if latched else "volatile",
            "deadline": dict(_NO_TIME),
            "lifespan": dict(_NO_TIME),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_NO_TIME),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def metadata_text(
    files: Mapping[str, Contents], topics: Sequence[BagTopic], contents: Contents
) -> str:
    """Return the text of ``metadata.yaml`` for a bag of files, by their names."""
    information = {
        "version": VERSION,
        "storage_identifier": "mcap",
        **contents.extent(),
        "topics_with_message_count": [_topic(topic, contents.counts) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": list(files),
        "files": [{"path": name, **each.extent()} for name, each in files.items()],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    text: str = yaml.dump(
        {"rosbag2_bagfile_information": information}, Dumper=_NoAliases, sort_keys=False
    )
    return text


def read_metadata(path: Path) -> Mapping[str, Any]:
    """Return what ``metadata.yaml`` states, with file names in a list ``relative_file_paths``.

    Raises InputError where it is not one.
    """
    information = load(path).get("rosbag2_bagfile_information")
    if not isinstance(information, Mapping):
        raise InputError(f"{path}: no mapping 'rosbag2_bagfile_information:'")
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{path}: no list of file names 'relative_file_paths:'")
    return information


def _topic(topic: BagTopic, counts: Mapping[str, int]) -> dict[str, Any]:
    metadata = {
        "name": topic.name,
        "type": topic.type_name,
        "serialization_format": "cdr",
        "offered_qos_profiles": offered_qos(latched=topic.latched),
        "type_description_hash": topic.type_hash,
    }
    return {"topic_metadata": metadata, "message_count": counts[topic.name]}


class _NoAliases(yaml.SafeDumper):
    def ignore_aliases(self, _: object) -> bool:
        """Write every value out: rosbag2's reader wants it plain."""
        return True


def bag_files(path: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Find the files of a rosbag2 folder or a single ``.mcap``, in order.

    Also returns a sentence for each thing that is missing. Raises InputError where there are none,
    or they are not MCAP.
    """
    if path.is_dir():
        files, warnings = _files_of_folder(path)
    elif path.is_file():
        files, warnings = (path,), ()
    else:
        raise InputError(f"{path} does not exist: give a rosbag2 folder or an .mcap file")
    for file in files:
        if not is_mcap(file):
            raise InputError(
                f"{file} is not an MCAP file: record with 'ros2 bag record -s mcap', or import a"
                " table by 'afm-scan import-csv'"
            )
        _refuse_sizes(file)
    return files, warnings + tuple(_cut(path, f) for f in files if not is_whole(f))


_CHUNK_HEAD = struct.Struct("<QQQ")  # both times of a chunk, and the bytes that it unpacks to
_FEW = 10**5
_LEAST = 50
"""Records beside messages that any file may have, and bytes of each in a larger one at least.

A chunk and its indices have more.
"""


def _refuse_sizes(path: Path) -> None:
    """Raise InputError where a file states more than a recording of its size can hold."""
    size, count, unpacked = path.stat().st_size, 0, 0
    try:
        with path.open("rb") as stream:
            place = stream.seek(len(MCAP0_MAGIC))
            while place + HEAD.size <= size and count <= _FEW + size / _LEAST:
                kind, length = HEAD.unpack(stream.read(HEAD.size))
                if kind == Opcode.CHUNK and place + HEAD.size + _CHUNK_HEAD.size <= size:
                    *_, stated = _CHUNK_HEAD.unpack(stream.read(_CHUNK_HEAD.size))
                    unpacked += stated if stated <= FREE else 0  # it is not unpacked
                    refuse_unfolding(unpacked, size)
                count += kind != Opcode.MESSAGE
                place += HEAD.size + length
                stream.seek(min(place, size))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    if count > _FEW + size / _LEAST:
        raise InputError(
            f"{path}: over {count} records beside messages in {size} bytes: record it again"
        )


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
    try:
        metadata = read_metadata(folder / NAME)
    except InputError as error:
        mend = f"remove it and run 'ros2 bag reindex {folder} -s mcap'"
        raise InputError(f"{error}: not a rosbag2 metadata file: {mend}") from error
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


def _by_number(path: Path) -> tuple[int, str]:
    """Order of split files: NAME_10 after NAME_9."""
    number = re.search(r"(\d+)$", path.stem)
    return int(number[1]) if number else 0, path.name


def _cut(bag: Path, file: Path) -> str:
    return (
        f"{file} was cut short: what its recorder had not finished writing is missing;"
        f" 'ros2 bag reindex {bag if bag.is_dir() else bag.parent} -s mcap' repairs its index"
    )
