"""A scan that was made: all its signals, from the first sample to rest."""

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import Tracking, TrackingMeter
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace


@frozen(eq=False)
class Scan:
    """All signals of a scan: displacements in m, drive in V, each of the scan's whole length.

    ``true``, the displacement without noise, is known of a simulated scanner alone.
    """

    spec: ScanSpec
    desired: Trace
    drive: Trace
    measured: Trace
    _true: Trace | None = None

    @property
    def knows_true(self) -> bool:
        """Whether the noise-free displacement is known."""
        return self._true is not None

    @property
    def true(self) -> Trace:
        """Return the noise-free displacement, m; raises InputError where it is not known."""
        if self._true is None:
            raise InputError("no noise-free displacement: only a simulated scanner knows it")
        return self._true

    def tracking(self, displacement: str) -> Tracking:
        """Figures of the ``measured`` or of the ``true``, noise-free, displacement."""
        meter = TrackingMeter(self.spec, displacement)
        meter.add(self.desired, self.true if displacement == "true" else self.measured)
        return meter.tracking()
