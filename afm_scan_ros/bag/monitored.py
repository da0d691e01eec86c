"""What messages of monitors hold, of a bag or of ROS: images of heights, and figures of lines."""

import numpy as np

from afm_scan_ros.bag.typestore import Message, stamp_of
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import LineError
from afm_scan_ros.core.types import Array

IMAGE = "sensor_msgs/msg/Image"
WAYS = {"scan_image/trace": "trace", "scan_image/retrace": "retrace"}
"""Ends of topics of images, and the directions that they show."""
KINDS = {("32FC1", False): np.dtype("<f4"), ("32FC1", True): np.dtype(">f4")}
"""Numbers of heights, by the encoding and whether the first byte is the highest."""


def way_of(topic: str) -> str | None:
    """Return the direction that a topic of images shows, in any namespace; None of another."""
    return next((way for end, way in WAYS.items() if f"/{topic}".endswith(f"/{end}")), None)


def heights(message: Message) -> Array:
    """Return the heights (m) of an image, (lines, pixels); raises ValueError for another image."""
    kind = KINDS.get((message.encoding, bool(message.is_bigendian)))
    if kind is None:
        raise ValueError(f"its encoding is '{message.encoding}'")
    values = np.frombuffer(np.asarray(message.data).tobytes(), kind)
    return values.reshape(message.height, message.width).astype(np.float64)


def line_of(info: ScanInfo, message: Message) -> LineError:
    """Return the figures of a line from a ``TrackingError`` message."""
    first = round(1e-9 * (stamp_of(message) - info.start) / info.sample_period)
    rms, largest = (message.rms_x, message.rms_y), (message.max_x, message.max_y)
    return LineError(message.line, first, *rms, *largest)
