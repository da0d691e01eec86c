"""Writes a rosbag2 folder: ``metadata.yaml`` and one MCAP file beside it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import yaml
from mcap.writer import CompressionType, Writer

from afm_scan_ros.bag.metadata import NAME, Contents, Topic, metadata_text, offered_qos
from afm_scan_ros.bag.typestore import typestore
from afm_scan_ros.core.errors import InputError, ScanError

CHUNK_BYTES = 512 * 1024
CHUNK_TIME = 10**9
UNLIMITED = 2**31


class BagWriter:
    """A bag that is being recorded; a context manager.

    A chunk of the file is finished, and given to the operating system, every half megabyte and
    every second of recorded time: a recorder that is killed leaves a bag that reads up to there.
    Raises InputError where the folder exists already, and from any method ScanError where the
    operating system takes no more, as on a full disk: the bag is closed then, as after a crash.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists():
            raise InputError(f"{folder} exists already: give another folder or remove it")
        self._folder = folder
        self._path = folder / f"{folder.name}_0.mcap"
        try:
            folder.mkdir(parents=True)
            self._stream = self._path.open("wb")
        except OSError as error:
            raise InputError(f"{folder}: no bag can be made here: {error.strerror}") from error
        self._mcap = Writer(self._stream, chunk_size=UNLIMITED, compression=CompressionType.NONE)
        self._mcap.start(profile="ros2")
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._topics: list[Topic] = []
        self._contents = Contents({})
        self._chunk_start = 0
        self._chunk_bytes = 0

    def add_topic(self, name: str, type_name: str, *, latched: bool = False) -> None:
        """Announce a topic, as ``/scan_info``, of a type, as ``afm_scan_ros/msg/ScanInfo``.

        A ``latched`` topic (transient local) replays to readers that come late.
        """
        store = typestore()
        if type_name not in self._schemas:
            definition, _ = store.generate_msgdef(type_name, ros_version=2)
            self._schemas[type_name] = self._mcap.register_schema(
                type_name, "ros2msg", definition.encode()
            )
        type_hash = store.hash_rihs01(type_name)
        qos: str = yaml.safe_dump(offered_qos(latched=latched), sort_keys=False).strip()
        metadata = {"offered_qos_profiles": qos, "topic_type_hash": type_hash}
        self._channels[name] = self._mcap.register_channel(
            name, "cdr", self._schemas[type_name], metadata
        )
        self._topics.append(Topic(name, type_name, type_hash, latched))
        self._contents.counts[name] = 0

    def write(self, topic: str, stamp: int, cdr: bytes) -> None:
        """Append a message that was serialised with its four-byte header; ``stamp`` in ns."""
        sequence = self._contents.counts[topic]
        self._mcap.add_message(self._channels[topic], stamp, cdr, stamp, sequence)
        self._contents.add(topic, stamp)
        if not self._chunk_bytes:
            self._chunk_start = stamp
        self._chunk_bytes += len(cdr)
        if self._chunk_bytes >= CHUNK_BYTES or abs(stamp - self._chunk_start) >= CHUNK_TIME:
            self.flush()

    def flush(self) -> None:
        """Finish the chunk and give all there is to the operating system."""
        with self._kept_to_here():
            self._mcap.flush()
        self._chunk_bytes = 0

    def close(self) -> None:
        """Finish the file and write ``metadata.yaml``; further calls do nothing."""
        if self._stream.closed:
            return
        text = metadata_text(self._path.name, self._topics, self._contents)
        unfinished = self._folder / f"{NAME}.unfinished"  # half a file would hide the bag
        with self._kept_to_here():
            self._mcap.finish()
            self._stream.close()
            unfinished.write_text(text, "utf-8")
            unfinished.replace(self._folder / NAME)

    def discard(self) -> None:
        """Close and remove a bag that nothing worth keeping was written to."""
        with suppress(OSError):  # what could not be written is not missed
            self._stream.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    @contextmanager
    def _kept_to_here(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            with suppress(OSError):  # it tries again what failed
                self._stream.close()
            if not self._path.exists():
                raise ScanError(f"{self._path} was removed during the scan: scan again") from error
            size = self._path.stat().st_size
            raise ScanError(
                f"{self._path}: {error.strerror} after {size / 1e6:.1f} MB, which can be read up to"
                " the last finished chunk: make room and scan again"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
