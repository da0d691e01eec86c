"""Node: writes every block of a scan, and what describes it, into a bag."""

import time
from collections import Counter
from functools import partial
from pathlib import Path

from rclpy.qos import DurabilityPolicy

from afm_scan_ros.bag.writer import BagWriter
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.block_consumer import BlockConsumer
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.peers import FAILED
from afm_scan_ros.nodes.topics import (
    BLOCKS,
    MODEL_RESIDUAL,
    MONITOR,
    SCAN_INFO,
    TRACKING_ERROR,
    NodeTopic,
)

LINE_TOPICS = (TRACKING_ERROR, MODEL_RESIDUAL)
"""One message a line; they have no last one, and come in no order with the blocks."""


class ScanRecorder(BlockConsumer):
    """Records messages as they came over the wire, after seeing that none is missing."""

    NAME = "scan_recorder"

    PARAMETERS = (
        NodeParameter("bag", "", "Folder to create for the bag"),
        NodeParameter("topics", list(BLOCKS), "Block topics to record"),
    )

    def __init__(self) -> None:
        super().__init__()
        topics = self._topics()
        if not self.settings["bag"]:
            raise InputError("parameter bag: give the folder to create, as -p bag:=scan1")
        self._recorded = False
        self._received: Counter[str] = Counter()
        self._latest = 0.0
        self._by_line: tuple[NodeTopic, ...] = ()
        self._bag = BagWriter(Path(self.settings["bag"]))
        for topic in topics:
            self.expect(topic)
        for topic in (SCAN_INFO, MONITOR, *LINE_TOPICS, *topics):
            self._record(topic)

    def receive_raw(self, topic: NodeTopic, name: str, data: bytes, number: int) -> None:
        """Write a message; follow its blocks like any consumer."""
        if self.leaving:
            return
        if topic.name in BLOCKS:
            self.receive(topic, data, number)
            self._recorded = True
        self._bag.write(name, time.time_ns(), data)
        self._received[topic.name] += 1
        self._latest = time.monotonic()
        if topic is SCAN_INFO:
            self._bag.flush()  # without it, no block of a bag cut short can be read

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - receive_raw's
        """Leave the block to ``receive_raw``; with the last one, learn who publishes lines."""
        if last:
            names = {each: self.resolve_topic_name(each.name) for each in LINE_TOPICS}
            self._by_line = tuple(t for t, name in names.items() if self.count_publishers(name))

    def awaited(self) -> tuple[str, ...]:
        """Return the topics that lack lines, until nothing has come for the liveness timeout.

        A monitor that can compute no more lines publishes none.
        """
        spec = self.scan.spec
        if spec is None or time.monotonic() - self._latest > self.settings["liveness_timeout_s"]:
            return ()
        return tuple(t.name for t in self._by_line if self._received[t.name] < spec.lines)

    def leave(self) -> None:
        """Finish the bag while an error can still be said."""
        super().leave()
        try:
            self._end_bag()
        except ScanError as error:
            self.status = self.status or 3
            self.go(FAILED, "; ".join(filter(None, (self.reason, str(error)))))

    def destroy_node(self) -> None:
        """Finish the bag too, where the node did not come to leave.

        Not twice: a bag that was discarded may have been made anew by another recorder.
        """
        if not self.leaving:
            self._end_bag()
        super().destroy_node()

    def _end_bag(self) -> None:
        """Finish the bag; one of a scan that never began would only stand in the way."""
        if self._recorded:
            self._bag.close()
        else:
            self._bag.discard()

    def _topics(self) -> list[NodeTopic]:
        names = self.settings["topics"]
        if unknown := sorted(set(names) - set(BLOCKS)):
            raise InputError(f"topics: '{unknown[0]}' is not one of {', '.join(BLOCKS)}")
        return [BLOCKS[name] for name in names]

    def _record(self, topic: NodeTopic) -> None:
        name = self.resolve_topic_name(topic.name)
        latched = topic.writer.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self._bag.add_topic(name, topic.type_name, latched=latched)
        self.subscribe(topic, partial(self.receive_raw, topic, name), raw=True)
