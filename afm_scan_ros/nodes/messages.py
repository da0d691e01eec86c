"""Core's records to messages; every stamp of a scan is made here."""

from array import array

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.bag.scan_info import ScanInfo, info_fields
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.nodes.line_errors import LineError
from afm_scan_ros.ros import Image, Message, NodeState, TrackingError
from afm_scan_ros.ros import ScanInfo as ScanInfoMessage


def info_message(info: ScanInfo) -> Message:
    """Return the message that announces a scan."""
    message = ScanInfoMessage()
    for name, value in info_fields(info).items():
        setattr(message, name, value)
    _stamp(message, info, 0)
    return message


def block_message(kind: type[Message], info: ScanInfo, block: Trace, *, last: bool) -> Message:
    """Return a block as a message of the class ``kind``."""
    message = kind()
    _stamp(message, info, block.first_sample)
    message.first_sample = block.first_sample
    message.sample_period = info.sample_period
    message.x, message.y = _doubles(block.x), _doubles(block.y)
    message.last = last
    return message


def tracking_message(info: ScanInfo, error: LineError) -> Message:
    """Return the error of one line as a message."""
    message = TrackingError()
    _stamp(message, info, error.first_sample)
    message.line = error.line
    message.rms_x, message.rms_y = error.rms_x, error.rms_y
    message.max_x, message.max_y = error.max_x, error.max_y
    return message


def image_message(info: ScanInfo, heights: NDArray[np.float32], sample: int) -> Message:
    """Return an image of heights (m), shape (rows, columns), as it was by a sample of the scan."""
    message = Image(encoding="32FC1", height=heights.shape[0], width=heights.shape[1])
    message.header.frame_id = "scanner"
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(info.stamp(sample), 10**9)
    message.step = heights.shape[1] * np.dtype(np.float32).itemsize
    data = array("B")
    data.frombytes(np.ascontiguousarray(heights, "<f4").data.cast("B"))
    message.data = data
    return message


def state_message(
    info: ScanInfo | None, node: str, state: str, next_sample: int, reason: str
) -> Message:
    """Return what a node says of itself; ``info`` is None until it takes part in a scan."""
    message = NodeState(node=node, state=state, next_sample=next_sample, reason=reason)
    if info is not None:
        _stamp(message, info, next_sample)
    return message


def _stamp(message: Message, info: ScanInfo, sample: int) -> None:
    message.scan_id = info.scan_id
    message.header.frame_id = "scanner"
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(info.stamp(sample), 10**9)


def _doubles(samples: Array) -> "array[float]":
    return array("d", samples.tobytes())  # rclpy would look at each element of anything else
