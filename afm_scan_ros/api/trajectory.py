"""The desired displacement of a scan."""

from afm_scan_ros.api.arrays import channels_of
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES, Array


def trajectory(spec: ScanSpec) -> Array:
    """Return the desired displacement (m) of a whole scan, (n, 2): x and y.

    It begins and ends at rest at zero, after the preparation, the approach and the settling of
    ``spec``; its sample period is ``spec.sample_period``.

    >>> import afm_scan_ros as afm
    >>> spec = afm.ScanSpec(range_x=10e-6, range_y=10e-6, lines=2, preparation="none")
    >>> desired = afm.trajectory(spec)
    >>> desired.shape, float(desired[:, 0].max())
    ((12001, 2), 5e-06)
    """
    return channels_of(desired(spec, 0, total_samples(spec)), AXES)
