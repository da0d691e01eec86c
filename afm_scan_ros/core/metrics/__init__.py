"""How far a scan came from where it should have been: figures, gathered block by block."""

from afm_scan_ros.core.metrics.figures import (
    AxisError,
    Contribution,
    Figure,
    Tracking,
    plain,
)
from afm_scan_ros.core.metrics.meter import TrackingMeter

__all__ = ["AxisError", "Contribution", "Figure", "Tracking", "TrackingMeter", "plain"]
