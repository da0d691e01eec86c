"""What a creep record cannot tell, in words, and what to record instead."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.model import CreepModel

VAGUE = 0.1
"""Half of a 95 % interval over the value, beyond which the value is not told."""

Interval = tuple[float, float]


def creep_warnings(
    model: CreepModel, intervals: Mapping[str, Interval], hold: float
) -> Iterator[str]:
    """Name each element that a record of ``hold`` s at most after a step does not determine."""
    for number, (gain, tau) in enumerate(zip(model.gains, model.time_constants, strict=True), 1):
        if gain < 0.0:
            yield (
                f"creep element {number} ({tau:.4g} s) has a negative gain, which no spring and"
                " damper has: the record drifts otherwise; let the scanner rest, then record again"
            )
        gains, taus = intervals[f"gain_{number}"], intervals[f"time_constant_{number}"]
        if max(half_width(gain, gains), half_width(tau, taus)) > VAGUE:
            known = f"{_known('gain', gain, gains)}, {_known('time constant', tau, taus, ' s')}"
            yield f"creep element {number}: this record cannot tell; {known}; {_instead(tau, hold)}"


def half_width(value: float, interval: Interval) -> float:
    """Half of an interval, relative to the value; inf where it is open."""
    low, high = interval
    return float(np.inf) if low == 0.0 else (high - low) / (2.0 * abs(value))


def _known(name: str, value: float, interval: Interval, unit: str = "") -> str:
    low, high = interval
    if np.isfinite(half_width(value, interval)):
        share = half_width(value, interval)
        return f"{name} {value:.4g}{unit} ±{share:.0%} ({low:.4g} to {high:.4g}{unit})"
    if low > 0.0:
        return f"{name} above {low:.4g}{unit}"
    return f"{name} below {high:.4g}{unit}" if np.isfinite(high) else f"{name} unknown"


def _instead(tau: float, hold: float) -> str:
    if tau > hold:
        return f"the drive was held for {hold:.0f} s; hold it for {np.ceil(tau / 60.0):.0f} min"
    return "take a larger step or sample faster"
