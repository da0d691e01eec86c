"""Writes a rosbag2 folder: ``metadata.yaml`` and the MCAP files beside it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from afm_scan_ros.bag.file_writer import FileWriter
from afm_scan_ros.bag.metadata import NAME, BagTopic, Contents, metadata_text
from afm_scan_ros.bag.typestore import typestore
from afm_scan_ros.core.errors import InputError, ScanError

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
        """Close and remove a bag that nothing worth keeping was written to."""
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
