"""What a creep record cannot tell, in words, and what to record instead."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.creep.profile import Interval
from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.types import Array

VAGUE = 0.1
"""Half of a 95 % interval over the value, beyond which the value is not told."""
MISSED = 1.1
"""Held-out error over the record's noise, beyond which it is more than noise."""
MOST = 1.0
"""Creep within a record, over its step: more is none."""
FOLLOWED = 5.0, 0.05
"""Error over the noise, and over the motion, up to which springs and dampers follow a record."""
APART = 1.0 / 3.0
"""Share of the longest hold up to which time constants are told from one another."""
SOUGHT = 1800.0
"""Seconds that a drive must be held for the slowest creep looked for, some 1700 s."""
MOVE = 0.01
"""Share of the fastest element that the hysteresis may hide in a step that takes time."""


def element_warnings(
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
            instead = _instead(tau, taus, hold)
            yield f"creep element {number}: this record cannot tell; {known}; {instead}"


def record_warnings(model: CreepModel, record: CreepRecord, held_out: Misfit) -> Iterator[str]:
    """Say where noise is not all that is missed, and where a step took too long."""
    noise = np.hypot(record.noise, _resolution(record.displacement))
    if held_out.sigma > MISSED * noise:
        yield (
            f"creep: the held-out error, sigma {1e9 * held_out.sigma:.3g} nm, exceeds the record's"
            f" noise of {1e9 * noise:.3g} nm: the record is too short, or the scanner drifts"
            " as no springs and dampers do; let it rest, keep its temperature, then hold it longer"
        )
    if model.time_constants[-1] > APART * record.longest and record.longest < SOUGHT:
        yield (
            f"creep: the drive was held for {record.longest:.0f} s at most: elements slower than"
            f" {APART * record.longest:.0f} s are told neither from one another nor from drift,"
            f" and one may stand for several; hold it for {SOUGHT / 60.0:.0f} min"
        )
    slowest = max(len(step.share) for step in record.steps) * record.sample_period
    if slowest > 2.0 * MOVE * model.time_constants[0]:
        hidden = slowest / (2.0 * model.time_constants[0])
        yield (
            f"creep: a step took {slowest:.2g} s, within which the hysteresis hides up to"
            f" {hidden:.1%} of element 1; step within one sample"
        )


def refuse_implausible(model: CreepModel, record: CreepRecord, fitted: Misfit) -> None:
    """Refuse what no scanner's creep is: all that follows would be read through it.

    Raises InputError, which says what to record instead.
    """
    made = -np.expm1(-record.longest / np.array(model.time_constants))
    creep = float(np.abs(model.gains) @ made)
    if creep > MOST:
        raise InputError(
            f"creep record: its motion after a step is {creep:.0%} of the step, and creep is less"
            " than all of it: the sensor drifts, or the drive does not hold; let the scanner rest,"
            " then record it again"
        )
    noise, motion = record.noise, np.ptp(record.displacement)
    if fitted.sigma > max(FOLLOWED[0] * noise, FOLLOWED[1] * motion):
        raise InputError(
            f"creep record: springs and dampers leave {1e9 * fitted.sigma:.3g} nm of it, its noise"
            f" is {1e9 * noise:.3g} nm: the drive does not hold, or the sensor is disturbed; record"
            " it again"
        )


def _resolution(displacement: Array) -> float:
    """Rms error, m, that the sensor's steps leave."""
    steps = np.abs(np.diff(displacement))
    return float(steps[steps > 0.0].min() / np.sqrt(12.0)) if steps.any() else 0.0


def half_width(value: float, interval: Interval) -> float:
    """Half of an interval, relative to the value; inf where it is open."""
    low, high = interval
    return float(np.inf) if 0.0 in interval else (high - low) / (2.0 * abs(value))


def _known(name: str, value: float, interval: Interval, unit: str = "") -> str:
    low, high = interval
    if np.isfinite(half_width(value, interval)):
        share = half_width(value, interval)
        return f"{name} {value:.4g}{unit} ±{share:.0%} ({low:.4g} to {high:.4g}{unit})"
    if low > 0.0:
        return f"{name} above {low:.4g}{unit}"
    return f"{name} below {high:.4g}{unit}" if np.isfinite(high) else f"{name} unknown"


def _instead(tau: float, interval: Interval, hold: float) -> str:
    if tau <= hold:
        return "take a larger step or sample faster"
    needed = tau if np.isfinite(interval[1]) else 10.0 * hold
    return f"the drive was held for {hold:.0f} s; hold it for {np.ceil(needed / 60.0):.0f} min"
