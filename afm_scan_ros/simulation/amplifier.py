"""The amplifier before the scanner: what it refuses, and how a scan in trouble ends."""

import numpy as np

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.simulation.spec import AmplifierSpec


def refuse_beyond_limits(spec: AmplifierSpec, drive: Trace, before: dict[str, float]) -> None:
    """Raise ScanError for the first sample of an axis beyond the voltage or the slew limit.

    ``before`` is the drive (V) of each axis one sample period before the block. NaN is refused.
    """
    for axis in AXES:
        voltage = drive.axis(axis)
        slew = np.diff(voltage, prepend=before[axis]) / drive.sample_period
        for quantity, values, limit in (
            ("drive [V]", voltage, spec.voltage_limit),
            ("slope of the drive [V/s]", slew, spec.slew_limit),
        ):
            beyond = np.flatnonzero(~(np.abs(values) <= limit))
            if beyond.size:
                raise ScanError(
                    f"sample {drive.first_sample + beyond[0]}, axis {axis}: {quantity} ="
                    f" {values[beyond[0]]:.6g} is beyond the amplifier's {limit:g}: scan a"
                    " smaller range or more slowly"
                )


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
