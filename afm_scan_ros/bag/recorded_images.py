"""The images of a scan that a bag holds: the last that was shown of each direction."""

from pathlib import Path

import numpy as np

from afm_scan_ros.bag.folder import bag_files
from afm_scan_ros.bag.mcap_file import runs
from afm_scan_ros.bag.typestore import Message, decode
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

IMAGE = "sensor_msgs/msg/Image"
TOPICS = {"scan_image/trace": "trace", "scan_image/retrace": "retrace"}
"""Ends of topics, in any namespace, and the directions that they show."""
KINDS = {("32FC1", False): np.dtype("<f4"), ("32FC1", True): np.dtype(">f4")}
"""Numbers of heights, by the encoding and whether the first byte is the highest."""


def recorded_images(path: Path) -> dict[str, Array]:
    """Return heights (m) by direction, (lines, pixels) each, row 0 scanned first; none if none is.

    Raises InputError where several topics show one direction, and for images of other values.
    """
    last: dict[str, tuple[str, bytes]] = {}
    for run in (run for file in bag_files(path).files for run in runs(file)):
        way = next((w for end, w in TOPICS.items() if run.topic.endswith(f"/{end}")), None)
        if run.type_name != IMAGE or way is None:
            continue
        if way in last and last[way][0] != run.topic:
            raise InputError(f"{path}: both {last[way][0]} and {run.topic}: record one scan a bag")
        last[way] = run.topic, run.cdrs[-1].tobytes()
    return {way: _heights(path, topic, cdr) for way, (topic, cdr) in last.items()}


def _heights(path: Path, topic: str, cdr: bytes) -> Array:
    try:
        image: Message = decode(IMAGE, cdr)
        kind = KINDS[image.encoding, bool(image.is_bigendian)]
        values = np.frombuffer(np.asarray(image.data).tobytes(), kind)
        return values.reshape(image.height, image.width).astype(np.float64)
    except (ValueError, KeyError) as error:
        raise InputError(
            f"{path}: {topic}: no image of heights: {error}: record it again"
        ) from error
