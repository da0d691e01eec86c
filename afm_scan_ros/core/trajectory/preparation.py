"""The preparation of a scan, which sets the hysteresis state before its lines."""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.shapes import smooth_step, soft_ramp
from afm_scan_ros.core.types import Array


def preparation_samples(spec: ScanSpec) -> int:
    """Samples that the preparation takes; 0 without one."""
    if spec.preparation == "none":
        return 0
    return round(spec.preparation_cycles / (spec.preparation_rate * spec.sample_period))


def preparation(spec: ScanSpec, samples: NDArray[np.int64]) -> Array:
    """Displacement in m, the same along both axes, at sample numbers from the scan's start."""
    cycles = spec.preparation_cycles * (samples / preparation_samples(spec))
    if spec.preparation == "saturate":
        return _excursions(spec, cycles)
    return _decaying_oscillation(spec, cycles)


def _excursions(spec: ScanSpec, cycles: Array) -> Array:
    """Go from zero to the upper bound and back, once a cycle."""
    result: Array = spec.preparation_upper * 0.5 * (1.0 - np.cos(2.0 * np.pi * cycles))
    return result


def _decaying_oscillation(spec: ScanSpec, cycles: Array) -> Array:
    """Swing between the bounds: a cycle to rise, a whole one, and the rest to decay evenly.

    The decay is linear in time, so that the extrema that the scanner remembers lie evenly.
    """
    rise = min(1.0, 0.25 * spec.preparation_cycles)
    decay = spec.preparation_cycles - 2.0 * rise
    envelope = smooth_step(cycles / rise) * (1.0 - soft_ramp((cycles - 2.0 * rise) / decay, 0.2))
    centre = 0.5 * (spec.preparation_upper + spec.preparation_lower)
    amplitude = 0.5 * (spec.preparation_upper - spec.preparation_lower)
    result: Array = envelope * (centre + amplitude * np.sin(2.0 * np.pi * (cycles % 1.0)))
    return result
