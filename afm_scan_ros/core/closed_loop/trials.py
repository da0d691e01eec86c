"""The scans by which a model is judged: the one that teaches it, and three unlike it."""

from attrs import evolve

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO

SAME = "same"
BRISK = 20.0
"""Line rate, Hz, above which the other rate is half of it and not twice: the drive has limits."""


def trials_of(spec: ScanSpec) -> dict[str, ScanSpec]:
    """Return a scan, and it at another rate, another amplitude, and along another pattern.

    All are sampled alike.
    """
    return {
        SAME: spec,
        "rate": _other_rate(spec),
        "amplitude": evolve(spec, range_x=0.5 * spec.range_x, range_y=0.5 * spec.range_y),
        "pattern": _other_pattern(spec),
    }


def _other_rate(spec: ScanSpec) -> ScanSpec:
    if spec.line_rate > BRISK:
        return evolve(
            spec, line_rate=0.5 * spec.line_rate, samples_per_line=2 * spec.samples_per_line
        )
    samples = 2 * (spec.samples_per_line // 4)  # even, so that trace and retrace are alike
    return evolve(
        spec,
        line_rate=spec.line_rate * spec.samples_per_line / samples,
        samples_per_line=samples,
        y_step=min(spec.y_step, 0.25 / spec.line_rate),
    )


def _other_pattern(spec: ScanSpec) -> ScanSpec:
    if spec.pattern in TO_AND_FRO:
        return evolve(spec, pattern="spiral")
    return evolve(spec, pattern="raster", y_step=min(spec.y_step, 0.5 / spec.line_rate))
