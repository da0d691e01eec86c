"""The displacement sensor: noise, then a converter of given resolution and span."""

import numpy as np

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.spec import SensorSpec


def read(spec: SensorSpec, true: Trace, rng: np.random.Generator) -> Trace:
    """Reading (m) of the true displacement (m): a whole number of quanta.

    Draws one normal number a sample and axis, in the samples' order, so that the readings do not
    depend on how they are cut into blocks. Raises ScanError where the span is too small.
    """
    noise = spec.noise_rms * rng.standard_normal((true.x.size, len(AXES)))
    x, y = (_convert(spec, true, axis, noise[:, i]) for i, axis in enumerate(AXES))
    return Trace(true.first_sample, true.sample_period, x, y)


def _convert(spec: SensorSpec, true: Trace, axis: str, noise: Array) -> Array:
    code = np.rint((true.axis(axis) + noise) / spec.quantum)
    half = 2 ** (spec.bits - 1)
    if not -half <= code.min() <= code.max() < half:  # NaN is not
        outside = np.flatnonzero(~((code >= -half) & (code < half)))[0]
        raise ScanError(
            f"sample {true.first_sample + outside}, axis {axis}: displacement ="
            f" {true.axis(axis)[outside]:.6g} m saturates the sensor, which spans"
            f" {spec.span:g} m: scan a smaller range"
        )
    return code * spec.quantum
