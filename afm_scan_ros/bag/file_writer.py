"""Writes one MCAP file of a bag, chunk by chunk."""

from collections.abc import Iterable
from pathlib import Path

import yaml
from mcap.writer import CompressionType, Writer

from afm_scan_ros.bag.metadata import BagTopic, Contents, offered_qos
from afm_scan_ros.bag.typestore import typestore

CHUNK_BYTES = 512 * 1024
CHUNK_TIME = 10**9
UNLIMITED = 2**31


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
