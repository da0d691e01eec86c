"""Converts records of core to messages, and computes the stamps of a scan."""

from array import array

import numpy as np
from attrs import asdict

from afm_scan_ros.bag.scan_info import ScanInfo, info_fields
from afm_scan_ros.core.streams import LineError, MonitorSample
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.ros import Header, Image, Message, NodeState, TrackingError
from afm_scan_ros.ros import MonitorSample as MonitorSampleMessage
from afm_scan_ros.ros import ScanInfo as ScanInfoMessage


def info_message(info: ScanInfo) -> Message:
    """Return the message that announces a scan."""
    return ScanInfoMessage(header=_header(info, 0), **info_fields(info))


def block_message(kind: type[Message], info: ScanInfo, block: Trace, *, last: bool) -> Message:
    """Return a block as a message of the class ``kind``."""
    return kind(
        header=_header(info, block.first_sample),
        scan_id=info.scan_id,
        first_sample=block.first_sample,
        sample_period=info.sample_period,
        x=_doubles(block.x),
        y=_doubles(block.y),
        last=last,
    )


def tracking_message(info: ScanInfo, error: LineError) -> Message:
    """Return the error of one line as a message."""
    figures = asdict(error, filter=lambda each, _: each.name != "first_sample")
    header = _header(info, error.first_sample)
    return TrackingError(header=header, scan_id=info.scan_id, **figures)


def monitor_message(info: ScanInfo, sample: MonitorSample) -> Message:
    """Return one sample for viewers as a message."""
    header = _header(info, sample.sample)
    return MonitorSampleMessage(header=header, scan_id=info.scan_id, **asdict(sample))


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


def _doubles(samples: Array) -> "array[float]":
    return array("d", samples.tobytes())  # rclpy would look at each element of anything else
