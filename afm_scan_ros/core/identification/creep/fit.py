"""A creep record → the springs and dampers in series of Eq. 1 (Croft, Shed & Devasia 2001).

While the drive rests after a step, so does the hysteresis' output F: the step's height in F is
unknown, its shape is not. The record therefore shows creep alone, whatever the hysteresis is.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.creep.record import CreepRecord, creep_record
from afm_scan_ros.core.identification.creep.series import (
    Interval,
    OrderTried,
    choose,
    intervals,
    refine,
    try_orders,
)
from afm_scan_ros.core.identification.findings import (
    CreepBeyondNoise,
    Finding,
    NegativeCreepGain,
    ShortHold,
    SlowStep,
    UndeterminedCreepElement,
)
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
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


HIGHEST = 6
"""Largest order that is tried."""


@frozen
class CreepFit:
    """The creep of one axis, and how well it is known."""

    model: CreepModel
    """The chosen order fitted to the whole record, its elements from the fastest."""
    order: int
    """Chosen by ``order.choose``."""
    orders: tuple[OrderTried, ...]
    """Each order tried, fitted without what is held out."""
    fitted: Misfit
    """Error of ``model`` on the whole record, m, sample by sample (Eqs. 2, 3)."""
    held_out: Misfit
    """Error of the chosen order, fitted without it, on the part held out, m."""
    noise: float
    """Noise of the record, rms, m: what varies from each sample to the next."""
    intervals: Mapping[str, Interval]
    """95 % interval of ``gain_1``, ``time_constant_1`` (s), …; an open one ends at 0 or inf."""
    warnings: tuple[Finding, ...]
    """What this record does not determine."""


def fit_creep(
    drive: Array, displacement: Array, sample_period: float, highest: int = HIGHEST
) -> CreepFit:
    """Fit Eq. 1, as 1 + Σ g_i/(1 + s τ_i), to one axis: drive (V) and displacement (m), both (n,).

    The order is chosen on the last hold, of which only the step's height is estimated, or where
    there is one hold alone, on its last quarter. The intervals take the noise for white. Raises
    InputError unless the drive rests, steps and holds still long enough.
    """
    record = creep_record(drive, displacement, sample_period)
    tried = try_orders(record, highest)
    chosen = choose(tried)
    averaged = record.averaged()
    series = refine(averaged, chosen.series)
    model = CreepModel(series.gains, series.time_constants)
    fitted = misfit(record.displacement - series.predict(record))
    refuse_implausible(model, record, fitted)
    found = intervals(averaged, series)
    return CreepFit(
        model=model,
        order=chosen.order,
        orders=tried,
        fitted=fitted,
        held_out=chosen.held_out,
        noise=record.noise,
        intervals=found,
        warnings=(
            *element_findings(model, found, record.longest),
            *record_findings(model, record, chosen.held_out),
        ),
    )
