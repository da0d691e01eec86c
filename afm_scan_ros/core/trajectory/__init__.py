"""The desired displacement of a scan, computed sample by sample from its ScanSpec alone."""

from afm_scan_ros.core.trajectory.kinds import SampleKinds, sample_kinds
from afm_scan_ros.core.trajectory.phases import Phases, phases, total_samples
from afm_scan_ros.core.trajectory.scan import desired, stopped, stopped_total

__all__ = [
    "Phases",
    "SampleKinds",
    "desired",
    "phases",
    "sample_kinds",
    "stopped",
    "stopped_total",
    "total_samples",
]
