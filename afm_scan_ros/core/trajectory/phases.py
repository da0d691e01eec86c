"""The phases of a scan: preparation, approach, lines and settling.

The preparation is an oscillation that sets the hysteresis state before the lines.
"""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.shapes import smooth_step, soft_ramp
from afm_scan_ros.core.types import Array


@frozen
class Phases:
    """The sample numbers of each phase of a scan; each phase begins where the one before ends."""

    preparation: range
    approach: range
    lines: range
    settle: range

    @property
    def total(self) -> int:
        """Samples in the scan."""
        return self.settle.stop


def phases(spec: ScanSpec) -> Phases:
    """Return where each phase of a scan lies; the very last sample is at rest at zero."""
    prepared = preparation_samples(spec)
    approached = prepared + approach_samples(spec)
    scanned = approached + spec.lines * spec.samples_per_line
    return Phases(
        preparation=range(prepared),
        approach=range(prepared, approached),
        lines=range(approached, scanned),
        settle=range(scanned, scanned + settle_samples(spec) + 1),
    )


def total_samples(spec: ScanSpec) -> int:
    """Samples in the whole scan, preparation, approach and settling included."""
    return phases(spec).total


def approach_samples(spec: ScanSpec) -> int:
    """Samples from rest at zero to the first line."""
    return max(1, round(spec.approach / spec.sample_period))


def settle_samples(spec: ScanSpec) -> int:
    """Samples from the last line's end to rest at zero."""
    return max(1, round(spec.settle / spec.sample_period))


def preparation_samples(spec: ScanSpec) -> int:
    """Samples that the preparation takes; 0 without one."""
    if spec.preparation == "none":
        return 0
    return round(spec.preparation_cycles / (spec.preparation_rate * spec.sample_period))


def preparation(spec: ScanSpec, samples: NDArray[np.int64]) -> Array:
    """Displacement in m, the same along both axes, at sample numbers from the scan's start."""
    cycles = spec.preparation_cycles * (samples / preparation_samples(spec))
    if spec.preparation == "saturate":
        # from zero to the upper bound and back, once a cycle
        return np.asarray(spec.preparation_upper * 0.5 * (1.0 - np.cos(2.0 * np.pi * cycles)))
    return _decaying_oscillation(spec, cycles)


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
