"""Figures of merit of a scan, gathered block by block."""

from afm_scan_ros.core.metrics.figures import AxisError, Figure, Tracking, plain
from afm_scan_ros.core.metrics.meter import TrackingMeter

__all__ = ["AxisError", "Figure", "Tracking", "TrackingMeter", "plain"]
