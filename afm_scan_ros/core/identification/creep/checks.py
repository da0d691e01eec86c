"""What a creep record does not determine, and what no scanner's creep is."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.creep.order import Interval
from afm_scan_ros.core.identification.creep.record import CreepRecord
from afm_scan_ros.core.identification.findings import (
    CreepBeyondNoise,
    Finding,
    NegativeCreepGain,
    ShortHold,
    SlowStep,
    UndeterminedCreepElement,
)
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.types import Array

VAGUE = 0.1
"""Half of a 95 % interval over the value, beyond which the value is undetermined."""
MISSED = 1.1
"""Held-out error over the record's noise, beyond which it is more than noise."""
MOST = 1.0
"""Largest creep within a record, over its step."""
FOLLOWED = 5.0, 0.05
"""Largest error of a creep model over the noise, and over the motion."""
APART = 1.0 / 3.0
"""Share of the longest hold up to which time constants can be separated."""
SOUGHT = 1800.0
"""Seconds that a drive must be held to determine the slowest creep expected, some 1700 s."""
MOVE = 0.01
"""Share of the fastest element that the hysteresis may hide in a step that takes time."""


def element_findings(
    model: CreepModel, intervals: Mapping[str, Interval], hold: float
) -> Iterator[Finding]:
    """Yield each element that a record of ``hold`` s at most after a step does not determine."""
    for number, (gain, tau) in enumerate(zip(model.gains, model.time_constants, strict=True), 1):
        if gain < 0.0:
            yield NegativeCreepGain(number, tau)
        gains, taus = intervals[f"gain_{number}"], intervals[f"time_constant_{number}"]
        if max(half_width(gain, gains), half_width(tau, taus)) > VAGUE:
            yield UndeterminedCreepElement(number, gain, gains, tau, taus, hold)


def record_findings(model: CreepModel, record: CreepRecord, held_out: Misfit) -> Iterator[Finding]:
    """Yield where the held-out error exceeds noise, the hold is short, or a step is slow."""
    noise = float(np.hypot(record.noise, _resolution(record.displacement)))
    if held_out.sigma > MISSED * noise:
        yield CreepBeyondNoise(held_out.sigma, noise)
    if model.time_constants[-1] > APART * record.longest and record.longest < SOUGHT:
        yield ShortHold(record.longest, APART * record.longest, SOUGHT)
    slowest = max(len(step.share) for step in record.steps) * record.sample_period
    if slowest > 2.0 * MOVE * model.time_constants[0]:
        yield SlowStep(slowest, slowest / (2.0 * model.time_constants[0]))


def refuse_implausible(model: CreepModel, record: CreepRecord, fitted: Misfit) -> None:
    """Refuse a record that is not creep: every later step would inherit its error.

    Raises InputError, which states what to record instead.
    """
    made = -np.expm1(-record.longest / np.array(model.time_constants))
    creep = float(np.abs(model.gains) @ made)
    if creep > MOST:
        raise InputError(
            f"creep record: the motion after a step is {creep:.0%} of the step, more than creep can"
            " be. Either the sensor drifts or the drive does not hold. Let the scanner rest, then"
            " record it again"
        )
    noise, motion = record.noise, np.ptp(record.displacement)
    if fitted.sigma > max(FOLLOWED[0] * noise, FOLLOWED[1] * motion):
        raise InputError(
            f"creep record: the residual of the creep model is {1e9 * fitted.sigma:.3g} nm rms, and"
            f" the noise is {1e9 * noise:.3g} nm rms. Either the drive does not hold or the sensor"
            " is disturbed. Record it again"
        )


def _resolution(displacement: Array) -> float:
    """Rms error, m, that the sensor's steps leave."""
    steps = np.abs(np.diff(displacement))
    return float(steps[steps > 0.0].min() / np.sqrt(12.0)) if steps.any() else 0.0


def half_width(value: float, interval: Interval) -> float:
    """Half of an interval, relative to the value; inf where it is open."""
    low, high = interval
    return float(np.inf) if 0.0 in interval else (high - low) / (2.0 * abs(value))
