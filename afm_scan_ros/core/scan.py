"""A scan that was made with a simulated scanner: all its signals, from the first sample to rest."""

from attrs import frozen

from afm_scan_ros.core.metrics import Tracking, TrackingMeter
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace


@frozen(eq=False)
class Scan:
    """All signals of a scan: displacements in m, drive in V, each of the scan's whole length."""

    spec: ScanSpec
    desired: Trace
    drive: Trace
    measured: Trace
    true: Trace

    def tracking(self, displacement: str) -> Tracking:
        """Figures of the ``measured`` or of the ``true``, noise-free, displacement."""
        meter = TrackingMeter(self.spec, displacement)
        meter.add(self.desired, {"measured": self.measured, "true": self.true}[displacement])
        return meter.tracking()
