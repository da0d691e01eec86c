"""How a scan flows from its source: blocks, window, pace; needs no ROS."""

import time
from datetime import UTC, datetime
from math import ceil

from afm_scan_ros.core.streams import MAX_BLOCK
from afm_scan_ros.nodes.parameters import NodeParameter

STOPPED = "stopped by request"
"""Begins the reason of a scan that is done, though not whole."""

MAX_MESSAGE_RATE = 200.0
"""Messages a second that a topic may carry in real time."""

USUAL_RATE = 50.0
"""Blocks a second of scan time, where nobody states their size: rclpy passes on a thousand."""
LEAST_BLOCK = 100
"""Samples."""
USUAL_WINDOW = 20
"""Blocks: 0.4 s of a scan, in which the inverse's preview and two blocks have to fit."""

TIME_SCALE = NodeParameter(
    "time_scale", 1.0, "Duration over scan time: 1 for real time, 0 for no pacing", low=0.0
)
FLOW = (
    NodeParameter(
        "block_size",
        0,
        f"Samples in a block; 0 for {USUAL_RATE:g} blocks a second of the scan, of"
        f" {LEAST_BLOCK} to {MAX_BLOCK} samples",
        low=0,
        high=MAX_BLOCK,
    ),
    NodeParameter(
        "window",
        0,
        f"Largest lead over the slowest node, in samples; 0 for {USUAL_WINDOW} blocks",
        low=0,
    ),
    TIME_SCALE,
    NodeParameter("min_subscriptions", 2, "Readers that the scan waits for", low=0),
    NodeParameter("scan_id", "", "Name of the scan; empty for its start time"),
    NodeParameter(
        "sampling_instant",
        "before_update",
        "When the sensor's samples are taken, seen from the converter's update",
        choices=("before_update", "after_update"),
    ),
    NodeParameter("trigger_offset_s", 0.0, "Time from the converter's update to the sample"),
)


def block_size_at(sample_period: float) -> int:
    """Return how many samples a block has where nobody says it; ``sample_period`` in s."""
    return min(MAX_BLOCK, max(LEAST_BLOCK, ceil(1.0 / (USUAL_RATE * sample_period) - 1e-9)))


def identity(scan_id: str) -> tuple[str, int]:
    """Return a scan's id, by default its start time, and the time, ns, at which it begins."""
    start = time.time_ns()
    moment = datetime.fromtimestamp(start / 1e9, UTC)
    return scan_id or moment.strftime("%Y%m%dT%H%M%S.%fZ"), start


def taking_part(*nodes: str) -> NodeParameter:
    """Declare the nodes that take part in a scan beside its source."""
    return NodeParameter(
        "required_nodes", list(nodes), "Nodes that take part, in the order of data flow"
    )
