"""What a model makes of a drive: the displacement of both axes of a whole record."""

from afm_scan_ros.core.coupling import Coupling
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import AXES, Trace


def predict(model: ScannerModel, drive: Trace) -> Trace:
    """Displacement (m) of a whole record from its drive (V), from depolarised rest at zero.

    Raises BeyondRangeError where the drive leaves the identified range.
    """
    period, own = drive.sample_period, {}
    for name in AXES:
        cascade = forward(model.axis(name), period)
        own[name] = cascade.apply(cascade.at_rest(), drive.axis(name))[1]
    coupling = Coupling(model, period)
    return coupling.apply(coupling.at_rest(), Trace(drive.first_sample, period, **own))[1]
