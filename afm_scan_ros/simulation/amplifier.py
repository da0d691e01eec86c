"""The amplifier before the scanner: how a scan in trouble ends."""

import numpy as np

from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.simulation.spec import AmplifierSpec


def ramp_down(
    spec: AmplifierSpec, first_sample: int, sample_period: float, before: dict[str, float]
) -> Trace:
    """Drive (V) from ``before`` to rest at zero, as half a cosine period.

    Its steepest slope is ``ramp_down_slew``, and both axes arrive together on its last sample.
    """
    start = np.array([before[axis] for axis in AXES])
    duration = 0.5 * np.pi * np.max(np.abs(start)) / spec.ramp_down_slew
    count = max(1, int(np.ceil(duration / sample_period)))
    fall = 0.5 * (1.0 + np.cos(np.pi * np.arange(1, count + 1) / count))
    return Trace(first_sample, sample_period, start[0] * fall, start[1] * fall)
