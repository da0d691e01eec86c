"""The scans that validate a model, and the preview that their inverses need.

The model is fitted to one scan; three others differ in rate, amplitude and pattern.
"""

from attrs import evolve

from afm_scan_ros.core.effects.vibration import LARGEST_TAIL
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO

FIRST = "same"
FAST_LINE_RATE = 20.0
"""Line rate, Hz, above which the other rate is half of it and not twice: the drive has limits."""


def validation_specs(spec: ScanSpec) -> dict[str, ScanSpec]:
    """Return a scan, and the same scan with another rate, amplitude and pattern.

    All have the same sample period.
    """
    return {
        FIRST: spec,
        "rate": _other_rate(spec),
        "amplitude": evolve(spec, range_x=0.5 * spec.range_x, range_y=0.5 * spec.range_y),
        "pattern": _other_pattern(spec),
    }


def _other_rate(spec: ScanSpec) -> ScanSpec:
    if spec.line_rate > FAST_LINE_RATE:
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


LEAST_PREVIEW = 0.03
"""Seconds that the inverses of a closed loop look ahead at least."""


def preview_of(model: ScannerModel, sample_period: float, least: float = LEAST_PREVIEW) -> float:
    """Preview (s) that the inverses of all axes need, at least ``least``.

    A lightly damped mode needs a long preview. Raises InputError where a response does not decay,
    or for an added effect that cannot be inverted.
    """
    settings = InverseSettings()
    chains = (chain_of(model.axis(name)) for name in model.axes)
    inverses = (chain.vibration(sample_period, settings).inverse for chain in chains)
    samples = max(inverse.kernel.preview_needed(LARGEST_TAIL) for inverse in inverses)
    return max(least, samples * sample_period)
