"""The Cyclone backend: the part of rclpy that the nodes use, over the Cyclone DDS binding."""

HOLDS_LOCK = "AFM_SCAN_WRITE_HOLDS_LOCK"
"""Variable, set by tests: a write that blocks keeps the interpreter locked, as rclpy's does."""
