"""Writes bags: MCAP files chunk by chunk, and the rosbag2 folder with its ``metadata.yaml``."""

import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import yaml
from mcap.writer import CompressionType, Writer

from afm_scan_ros.bag.folder import NAME, BagTopic, Contents, metadata_text, offered_qos
from afm_scan_ros.bag.scan_info import STREAMS, encode_block, encode_info
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.typestore import typestore
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import end, part
from afm_scan_ros.core.types import Trace

CHUNK_BYTES = 512 * 1024
CHUNK_TIME = 10**9
UNLIMITED = 2**31

BLOCK = 1000
"""Samples of a stream that ``write_record`` writes at once."""


class FileWriter:
    """An MCAP file that is being recorded.

    A chunk is finished, and given to the operating system, every half megabyte and every second of
    recorded time. Where each chunk lies is kept until the file ends, 0.6 kB for each. Methods
    raise OSError where the operating system takes no more.
    """

    def __init__(self, path: Path, topics: Iterable[BagTopic]) -> None:
        self.path = path
        self.contents = Contents({})
        self.chunks = 0
        self._stream = path.open("wb")
        self._mcap = Writer(self._stream, chunk_size=UNLIMITED, compression=CompressionType.NONE)
        self._mcap.start(profile="ros2")
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._chunk_start = 0
        self._chunk_bytes = self._chunk_time = 0
        for topic in topics:
            self.add_topic(topic)

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._stream.closed

    @property
    def chunk_is_due(self) -> bool:
        """Whether the chunk is to be finished."""
        return self._chunk_bytes >= CHUNK_BYTES or self._chunk_time >= CHUNK_TIME

    def add_topic(self, topic: BagTopic) -> None:
        """Announce a topic; what it offers is written as rosbag2 does."""
        if topic.type_name not in self._schemas:
            definition, _ = typestore().generate_msgdef(topic.type_name, ros_version=2)
            self._schemas[topic.type_name] = self._mcap.register_schema(
                topic.type_name, "ros2msg", definition.encode()
            )
        qos: str = yaml.safe_dump(offered_qos(latched=topic.latched), sort_keys=False).strip()
        metadata = {"offered_qos_profiles": qos, "topic_type_hash": topic.type_hash}
        self._channels[topic.name] = self._mcap.register_channel(
            topic.name, "cdr", self._schemas[topic.type_name], metadata
        )
        self.contents.counts[topic.name] = 0

    def write(self, topic: str, stamp: int, cdr: bytes, sequence: int) -> None:
        """Append a message; ``stamp`` in ns."""
        self._mcap.add_message(self._channels[topic], stamp, cdr, stamp, sequence)
        self.contents.add(topic, stamp)
        if not self._chunk_bytes:
            self._chunk_start = stamp
        self._chunk_bytes += len(cdr)
        self._chunk_time = abs(stamp - self._chunk_start)

    def flush(self) -> None:
        """Finish the chunk and give all there is to the operating system."""
        self._mcap.flush()
        self.chunks += 1
        self._chunk_bytes = self._chunk_time = 0

    def finish(self) -> None:
        """Write where everything lies, and end the file."""
        self._mcap.finish()
        self._stream.close()

    def abandon(self) -> None:
        """End the file as it is; raises OSError once more where it failed before."""
        self._stream.close()


FILE_CHUNKS = 2000
"""Chunks of a file: a gigabyte, or half an hour where little is recorded."""


class BagWriter:
    """A bag that is being recorded; a context manager.

    A recorder that is killed leaves a bag that reads up to the last chunk that was finished. After
    so many chunks the next file is begun, so that what is kept in memory of a file does not grow
    with the bag. Raises InputError where the folder exists already, and from any method ScanError
    where the operating system takes no more, as on a full disk: the bag is closed then, as after a
    crash.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists():
            raise InputError(f"{folder} exists already: give another folder or remove it")
        self._folder = folder
        self._topics: list[BagTopic] = []
        self._files: dict[str, Contents] = {}
        self._contents = Contents({})
        try:
            folder.mkdir(parents=True)
            self._file = self._next_file()
        except OSError as error:
            raise InputError(f"{folder}: no bag can be made here: {error.strerror}") from error

    def add_topic(self, name: str, type_name: str, *, latched: bool = False) -> None:
        """Announce a topic, as ``/scan_info``, of a type, as ``afm_scan_ros/msg/ScanInfo``.

        A ``latched`` topic (transient local) replays to readers that come late.
        """
        topic = BagTopic(name, type_name, typestore().hash_rihs01(type_name), latched)
        self._file.add_topic(topic)
        self._topics.append(topic)
        self._contents.counts[name] = 0

    def write(self, topic: str, stamp: int, cdr: bytes) -> None:
        """Append a message that was serialised with its four-byte header; ``stamp`` in ns."""
        if self._file.chunks >= FILE_CHUNKS:
            with self._kept_to_here():
                self._file.finish()
                self._file = self._next_file()
        self._file.write(topic, stamp, cdr, self._contents.counts[topic])
        self._contents.add(topic, stamp)
        if self._file.chunk_is_due:
            self.flush()

    def flush(self) -> None:
        """Finish the chunk and give all there is to the operating system."""
        with self._kept_to_here():
            self._file.flush()

    def close(self) -> None:
        """Finish the file and write ``metadata.yaml``; further calls do nothing."""
        if self._file.closed:
            return
        text = metadata_text(self._files, self._topics, self._contents)
        unfinished = self._folder / f"{NAME}.unfinished"  # half a file would hide the bag
        with self._kept_to_here():
            self._file.finish()
            unfinished.write_text(text, "utf-8")
            unfinished.replace(self._folder / NAME)

    def discard(self) -> None:
        """Close and remove a bag without samples."""
        with suppress(OSError):  # what could not be written is not missed
            self._file.abandon()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _next_file(self) -> FileWriter:
        name = f"{self._folder.name}_{len(self._files)}.mcap"
        file = FileWriter(self._folder / name, self._topics)
        self._files[name] = file.contents
        return file

    @contextmanager
    def _kept_to_here(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            with suppress(OSError):  # it tries again what failed
                self._file.abandon()
            path = self._file.path
            if not path.exists():
                raise ScanError(f"{path} was removed during the scan: scan again") from error
            size = path.stat().st_size
            raise ScanError(
                f"{path}: {error.strerror} after {size / 1e6:.1f} MB, which can be read up to"
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


class ScanWriter(BagWriter):
    """A bag with one scan, of these ``streams``. Raises InputError where the folder exists."""

    def __init__(self, folder: Path, info: ScanInfo, streams: Iterable[str] = STREAMS) -> None:
        super().__init__(folder)
        self._info = info
        self.add_topic("/scan_info", SCAN_INFO, latched=True)
        for name in streams:
            self.add_topic(f"/{name}", STREAMS[name])
        self.put("scan_info", 0, encode_info(info))
        self.flush()  # without it the rest would mean nothing

    def add(self, name: str, trace: Trace) -> None:
        """Append the next samples of a stream, as ``desired_displacement``."""
        last = end(trace) == self._info.total_samples
        cdr = encode_block(STREAMS[name], self._info, trace, last=last)
        self.put(name, trace.first_sample, cdr)

    def put(self, name: str, sample: int, cdr: bytes) -> None:
        """Append a message at the moment of its first sample."""
        self.write(f"/{name}", self._info.stamp(sample), cdr)


def write_record(bag: Path, info: ScanInfo, streams: dict[str, Trace]) -> None:
    """Write streams as a bag; its time begins at 0, since the files do not state when it was."""
    with ScanWriter(bag, info) as writer:
        for first in range(0, info.total_samples, BLOCK):
            for stream, trace in streams.items():
                stop = min(first + BLOCK, info.total_samples)
                writer.add(stream, part(trace, first, stop))
