"""Messages made from records of core, sent in order, and checks of the blocks that come in."""

from collections import deque
from math import isfinite
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from attrs import define, field
from rclpy._rclpy_pybind11 import RCLError
from rclpy.publisher import Publisher
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from afm_scan_ros.bag.scan_info import Block, decode_block, info_fields
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import MAX_BLOCK
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.msg import NodeState
from afm_scan_ros.msg import ScanInfo as ScanInfoMessage

if TYPE_CHECKING:
    from array import array

Message: TypeAlias = Any
"""Of a class that rosidl makes from a definition in ``msg/``."""

NOT_TOLD = 2**64 - 1
"""Number of a message where the middleware does not count them."""


class BlockGuard:
    """Checks the blocks of one topic through one scan; refuses any that differs from the scan."""

    def __init__(
        self, topic: str, type_name: str, scan_id: str, sample_period: float, total_samples: int
    ) -> None:
        self.topic, self.type_name = topic, type_name
        self.scan_id = scan_id
        self.sample_period = sample_period
        self.total_samples = total_samples
        self.next_sample = 0
        self.complete = False
        self._number: int | None = None

    def accept(self, cdr: bytes, number: int) -> Trace:
        """Return the samples of the block that follows on the one before.

        ``cdr`` is the message as it came over the wire, and ``number`` its number among those of
        its publisher, where DDS tells it: all blocks are of one publisher.
        Raises ScanError naming the topic, the sample and what is wrong with it.
        """
        try:
            block = decode_block(self.type_name, cdr)
        except ValueError as error:
            raise ScanError(f"{self.topic}: {error}") from error
        trace = block.trace
        self._check_scan(block)
        self._check_size(trace.x, trace.y)
        self._check_place(trace.first_sample, trace.first_sample + len(trace.x))
        self._check_numbers(trace.x, trace.y)
        self._check_publisher(number)
        self.next_sample += len(trace.x)
        self.complete = block.last
        return trace

    def _check_scan(self, block: Block) -> None:
        if block.scan_id != self.scan_id:
            self._refuse(f"a block of scan '{block.scan_id}' came during scan '{self.scan_id}'")
        if (trace := block.trace).sample_period != self.sample_period:
            self._refuse(
                f"the sample period changed from {self.sample_period:g} s to"
                f" {trace.sample_period:g} s at sample {trace.first_sample}"
            )

    def _check_size(self, x: Array, y: Array) -> None:
        if len(x) != len(y):
            self._refuse(f"sample {self.next_sample}: {len(x)} x values but {len(y)} y values")
        if not 0 < len(x) <= MAX_BLOCK:
            self._refuse(f"sample {self.next_sample}: {len(x)} samples, not 1 to {MAX_BLOCK}")

    def _check_place(self, first: int, end: int) -> None:
        if self.complete:
            self._refuse(f"a block at sample {first} came after the scan's last block")
        if first > self.next_sample:
            late = "" if self.next_sample else ", or this node came late"
            missing = f"samples {self.next_sample} to {first - 1} are missing"
            self._refuse(f"{missing}: a block was lost{late}")
        if first < self.next_sample:
            self._refuse(f"sample {first} came again, where {self.next_sample} was due")
        if end > self.total_samples:
            self._refuse(f"sample {end - 1} is beyond the {self.total_samples} of the scan")

    def _check_numbers(self, x: Array, y: Array) -> None:
        if isfinite(np.vdot(x, y)):  # one number that is not finite spoils it, whatever the rest
            return
        for axis, samples in zip(AXES, (x, y), strict=True):
            for place in np.flatnonzero(~np.isfinite(samples)):
                where = f"sample {self.next_sample + place}, {axis}"
                self._refuse(f"{where}: {samples[place]} is not a finite number")

    def _check_publisher(self, number: int) -> None:
        if self._number is not None and number not in {self._number + 1, NOT_TOLD}:
            self._refuse(f"the block at sample {self.next_sample} is of another publisher")
        self._number = number

    def _refuse(self, why: str) -> None:
        raise ScanError(f"{self.topic}: {why}")


def info_message(info: ScanInfo) -> Message:
    """Return the message that announces a scan."""
    return ScanInfoMessage(header=_header(info, 0), **info_fields(info))


def image_message(info: ScanInfo, heights: "array[int]", columns: int, sample: int) -> Message:
    """Return an image as it was by a sample of the scan, from the bytes of float32 heights (m).

    The bytes are not copied, so the image must be sent before it changes.
    """
    step = columns * np.dtype(np.float32).itemsize
    return Image(
        header=_header(info, sample),
        encoding="32FC1",
        height=len(heights) // step,
        width=columns,
        step=step,
        data=heights,
    )


def state_message(
    info: ScanInfo | None, node: str, state: str, next_sample: int, reason: str
) -> Message:
    """Return the state message of a node; ``info`` is None until it takes part in a scan."""
    said = {"node": node, "state": state, "next_sample": next_sample, "reason": reason}
    if info is None:
        return NodeState(**said)
    return NodeState(header=_header(info, next_sample), scan_id=info.scan_id, **said)


def _header(info: ScanInfo, sample: int) -> Message:
    header = Header(frame_id="scanner")
    header.stamp.sec, header.stamp.nanosec = divmod(info.stamp(sample), 10**9)
    return header


AFTERLIFE = 22.0
"""Seconds for which DDS may count a killed process's endpoints: 10, and 20 in Fast DDS."""


@define(eq=False)
class Outbox:
    """The messages of one publisher that are still to be sent.

    A reader whose process was stopped or killed acknowledges nothing. After 5000 messages Fast DDS
    refuses the next one, a tenth of a second after it was given. It is then offered again.
    """

    publisher: Publisher
    _waiting: deque[Message] = field(factory=deque, init=False)
    _refused_since: float | None = field(default=None, init=False)

    def send(self, message: Message, now: float) -> None:
        """Publish a message after those that wait; ``now`` (s) is of any steady clock."""
        self._waiting.append(message)
        self.flush(now)

    def flush(self, now: float) -> bool:
        """Publish what waits; return whether all is sent.

        Raises ScanError where DDS has refused for longer than it counts a killed reader.
        """
        while self._waiting:
            try:
                self.publisher.publish(self._waiting[0])
            except RCLError as error:
                self._look_at(error, now)
                return False
            self._waiting.popleft()
            self._refused_since = None
        return True

    def _look_at(self, error: RCLError, now: float) -> None:
        if self._refused_since is None:
            self._refused_since = now
        if now - self._refused_since > AFTERLIFE:
            topic = self.publisher.topic_name
            raise ScanError(
                f"{topic} cannot be published for {AFTERLIFE:g} s: {error}; end the node that reads"
                " it and does not answer"
            ) from error
