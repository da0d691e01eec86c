"""What messages of monitors hold, of a bag or of ROS."""

import numpy as np

from afm_scan_ros.bag.typestore import Message, stamp_of
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import LineError
from afm_scan_ros.core.types import Array

IMAGE_TOPICS = {"scan_image/trace": "trace", "scan_image/retrace": "retrace"}
"""Ends of topics of images, and their names in the view."""


def line_of(info: ScanInfo, message: Message) -> LineError:
    """Return the figures of a line from a ``TrackingError`` message."""
    first = round(1e-9 * (stamp_of(message) - info.start) / info.sample_period)
    rms, largest = (message.rms_x, message.rms_y), (message.max_x, message.max_y)
    return LineError(message.line, first, *rms, *largest)


def heights(message: Message) -> Array:
    """Return the heights, m, of an image of float32 that ``scan_imager`` publishes."""
    values = np.frombuffer(np.asarray(message.data).tobytes(), "<f4")
    return values.reshape(message.height, message.width).astype(np.float64)
