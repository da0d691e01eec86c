"""rclpy's names over the Cyclone DDS binding, for machines without ROS 2: what nodes use of it."""

HOLDS_LOCK = "AFM_SCAN_WRITE_HOLDS_LOCK"
"""Variable, set by tests: a write that blocks keeps the interpreter locked, as rclpy's does."""
