"""A parameter that a node does not have is named."""

from rclpy.node import Node

from afm_scan_ros.nodes.declare import undeclared
from helpers.ros import joined


def test_a_parameter_that_is_set_and_unknown_is_named() -> None:
    with joined(line_rate=30.0, known=1):
        node = Node("node")
        node.declare_parameter("known", 0)
        assert undeclared(node) == ["line_rate"]
