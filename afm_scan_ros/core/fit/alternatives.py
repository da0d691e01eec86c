"""Fits that compete with that by plays: by another operator, another sensor, another start."""

from collections.abc import Callable, Sequence
from copy import copy
from functools import partial
from typing import TypeAlias

import numpy as np
from attrs import evolve

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.fit.candidates import (
    begun_at_rest,
    evidence_left_out,
    read_after,
    read_late,
    with_one_state,
    with_sensor,
    without_lags,
)
from afm_scan_ros.core.fit.descent import LINEAR, settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.modes import add_mode
from afm_scan_ros.core.fit.noise import correlation_length
from afm_scan_ros.core.types import ProgressCallback

Changed: TypeAlias = Callable[[], AxisFit | None]
"""Makes another fit, where there is one."""


def better(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return the fit by plays, the paper's operator, or by what has clearly the greater evidence.

    That is an operator of one state, a sensor with a low-pass of its own, or both. Behind a
    low-pass records may show anew that they began at rest. Nothing else is tried where hardly more
    than the sensor's noise is left.
    """
    sensed = _with_any_sensor(fit, progress)
    if sensed is not fit:
        resting = with_rest(sensed, progress)
        fit = sensed if resting is sensed else _with_any_sensor(resting, progress)
    if fit.sufficient:
        progress("hardly more than noise is left")
        return fit
    progress("fitting the hysteresis by one state")
    other = _preferred(fit, partial(with_one_state, fit), progress, "one state")
    if other is fit:
        return fit
    whole = [evolve(one, first=0) for one in other.records]
    other = AxisFit(other.layout, whole, other.gain, other.theta, other.discrepancy, other.scales)
    other = with_rest(other, progress)
    while add_mode(other):
        settle(other, other.layout.settings.most_steps, searching=True)
    return _with_any_sensor(other, progress)


def with_rest(fit: AxisFit, progress: ProgressCallback, groups: Sequence[str] = ()) -> AxisFit:
    """Return a fit in which records began at rest where that has clearly the greater evidence.

    Steps to it are of some ``groups`` of parameters, or of all. All records of unknown start are
    tried at once, and where these clearly did not all rest, those one by one whose memory is
    estimated.
    """
    unknown = [k for k, record in enumerate(fit.records) if not record.rested]
    estimated = [k for k, record in enumerate(fit.records) if record.unknown is not None]
    if not unknown:
        return fit
    clear, name = fit.layout.settings.mode_chance, "rest before all records"
    resting = partial(begun_at_rest, fit, unknown)
    other, lead = _compared(fit, resting, progress, name, groups, evidence_left_out(fit))
    if lead > clear:
        return other
    for k in estimated if len(unknown) > 1 and lead < -clear else []:
        name = f"rest before {fit.records[k].name}"
        fit = _preferred(fit, partial(begun_at_rest, fit, [k]), progress, name, groups)
    return fit


def with_told_reading(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return a fit whose records were read after their drives' updates, where these show it.

    Without any lag such a fit has to explain clearly more than one of lags that reads before the
    updates. A fit of modes is as good either way, and records of drives that are not held have no
    updates.
    """
    if all(one.ahead for one in fit.records):
        return read_after(fit)
    if not (fit.lags_alone and all(one.held for one in fit.records)):
        return fit
    groups = (*fit.layout.operator.parts, *LINEAR, "rest", "memory")
    before, name = copy(fit), "reading after the drive's updates"
    before.records = list(fit.records)
    after = partial(read_after, without_lags(fit))
    _, lead = _compared(before, after, progress, name, groups)
    return read_after(fit) if lead > fit.layout.settings.mode_chance else fit


def with_told_lags(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return a fit, or one without lags where these are all that there is of its vibration.

    They stay where they have clearly the greater evidence, for loops of one rate look like a lag,
    and where they are hidden between samples: there the model leaves them out.
    """
    if not fit.lags_alone or fit.hidden_lag:
        return fit
    return _preferred(without_lags(fit), lambda: fit, progress, "a lag of the vibration")


def without_lead(fit: AxisFit, progress: ProgressCallback, groups: Sequence[str] = ()) -> AxisFit:
    """Return a fit without lags where these lead by more than the fastest one is long.

    No scanner leads. It is read after the updates where that explains more, and what was fitted
    beside the lags is fitted anew.
    """
    if not fit.lags_alone or fit.mean_lag > -float(fit.layout.lags[0]):
        return fit
    progress("fitting without a lead")
    plain = without_lags(fit)
    settle(plain, fit.layout.settings.most_steps, groups, searching=True)
    if fit.layout.reads_after or not all(one.held for one in fit.records):
        return plain
    name = "reading after the drive's updates"
    other, lead = _compared(plain, partial(read_after, plain), progress, name, groups)
    return other if lead > 0.0 else plain


def _with_any_sensor(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return a fit, or one with a sensor of its own that has clearly the greater evidence.

    A steeper low-pass and a delay are tried beside the sensor so far, and a delay in its place.
    None is where only noise is left, or hardly more of records that show a mode: what a low-pass
    leaves of slower records is slight, and large at other rates.
    """
    while not (fit.at_noise or (fit.sufficient and fit.layout.modes > 0)):
        order, delayed = fit.layout.sensor_order, fit.layout.delayed
        sensors = {(order + 2, delayed), (order, True), (0, True)} - {(order, delayed)}
        steepest = fit.layout.settings.steepest_sensor
        every = [with_sensor(fit, n, delayed=d) for n, d in sorted(sensors) if n <= steepest]
        some = [one for one in every if one is not None]
        if not some:
            break
        other = min(some, key=lambda one: one.discrepancy)
        before, sensor = fit, other.layout.sensor_of(other.theta)
        fit = _preferred(fit, partial(read_late, other), progress, f"a measuring chain, {sensor},")
        if fit is before:
            break
    return fit


def _preferred(
    fit: AxisFit,
    changed: Changed,
    progress: ProgressCallback,
    name: str,
    groups: Sequence[str] = (),
) -> AxisFit:
    """Return a fit, or a changed one whose evidence leads by as much as a mode has to explain."""
    other, lead = _compared(fit, changed, progress, name, groups)
    return other if lead > fit.layout.settings.mode_chance else fit


def _compared(
    fit: AxisFit,
    changed: Changed,
    progress: ProgressCallback,
    name: str,
    groups: Sequence[str] = (),
    handicap: float = 0.0,
) -> tuple[AxisFit, float]:
    """Return a changed fit and by how much its evidence leads (nat), after steps of some groups.

    The ``handicap`` (nat) is the evidence of what only the changed fit counts.

    The evidence is that of independent residuals, so the lead is divided by their correlation
    length. A fit that diverges is none of the scanner's, and none leads where there is none.
    """
    try:
        other = changed()
        if other is None:
            return fit, -np.inf
        lead = _lead(fit, other, groups, handicap)
        if lead > 0.0:
            settle(other, other.layout.settings.most_steps, groups, searching=True)
            lead = other.evidence() - fit.evidence() - handicap
    except ScanError as error:
        progress(f"{name}: {error}")
        return fit, -np.inf
    lead /= _longest_correlation(other)
    progress(f"{name} has {lead:.3g} nat more evidence")
    return other, lead


def _longest_correlation(fit: AxisFit) -> float:
    """Blocks of the most correlated residual that tell as much as one independent block."""
    return max(map(correlation_length, fit.residuals()))


def _lead(fit: AxisFit, other: AxisFit, groups: Sequence[str], handicap: float) -> float:
    """By how much (nat) another fit has the greater evidence.

    Both take steps in turn until they converge or stall, or what may remain of the objective of
    either would hardly change whether that lead is clear.
    """
    settings, lead = fit.layout.settings, 0.0
    for _ in range(settings.most_steps // settings.stage_steps):
        for each in (fit, other):
            settle(each, settings.stage_steps, groups, searching=True)
        lead = other.evidence() - fit.evidence() - handicap
        beyond = lead - settings.mode_chance * _longest_correlation(other)
        remaining = fit.remaining if beyond > 0.0 else other.remaining
        decided = abs(beyond) > settings.decided * remaining
        if decided or all(each.converged or each.stalled for each in (fit, other)):
            break
    return lead
