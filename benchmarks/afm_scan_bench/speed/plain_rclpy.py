"""Plain rclpy nodes that move a scan's blocks from process to process and do nothing else.

What the nodes' speed is held against: an executor that calls back for each block, through the hops
of a scan to the same readers.
"""

import sys
import time
from array import array

import rclpy
from rclpy.node import Node

from afm_scan_ros.msg import DisplacementBlock
from afm_scan_ros.nodes import middleware
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.topics import DESIRED

READS = {
    "source": (),
    "compensator": ("desired",),
    "scanner": ("drive",),
    "recorder": ("desired", "drive", "achieved", "true"),
}
WRITES = {
    "source": ("desired",),
    "compensator": ("drive",),
    "scanner": ("achieved", "true"),
    "recorder": (),
}
MEETING = 1.0
"""Seconds after which those further on have met as well."""


class Part(Node):
    """One part of the chain: what it reads it publishes; ``times`` (s) of what came are kept."""

    def __init__(self, part: str) -> None:
        super().__init__(part)
        self.times: list[float] = []
        self.writers = [
            self.create_publisher(DisplacementBlock, name, DESIRED.writer) for name in WRITES[part]
        ]
        for name in READS[part]:
            self.create_subscription(DisplacementBlock, name, self.pass_on, DESIRED.reader)

    def pass_on(self, message: Message) -> None:
        """Publish a block."""
        self.times.append(time.perf_counter())
        for writer in self.writers:
            writer.publish(message)


def main(part: str, size: int, blocks: int) -> None:
    """Play one part of a scan of so many blocks; the recorder prints how many it got a second."""
    middleware.prepare()
    rclpy.init(args=[])
    node = Part(part)
    for writer, name in zip(node.writers, WRITES[part], strict=True):
        while writer.get_subscription_count() < sum(name in names for names in READS.values()):
            time.sleep(0.01)
    if part == "source":
        time.sleep(MEETING)
        samples = array("d", [1e-9 * i for i in range(size)])
        block = DisplacementBlock(scan_id="plain", sample_period=1e-5, x=samples, y=samples)
        for number in range(blocks):
            block.first_sample = number * size
            node.pass_on(block)
    while len(node.times) < blocks * max(1, len(READS[part])):
        rclpy.spin_once(node)
    for writer in node.writers:
        while writer.get_subscription_count():  # gone when they have it all
            time.sleep(0.01)
    if part == "recorder":
        sys.stdout.write(f"{(blocks - 1) / (node.times[-1] - node.times[0])}\n")
    node.destroy_node()
    rclpy.shutdown()
