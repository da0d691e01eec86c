"""Fits that compete with that by plays: by another operator, another sensor, another start."""

from collections.abc import Callable, Sequence
from copy import copy
from functools import partial
from typing import TypeAlias

import numpy as np
from attrs import evolve

from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.fit.delays import by_whole_samples, read_late
from afm_scan_ros.core.fit.descent import LINEAR, VIBRATION, settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.modes import add, add_first_mode, add_mode, further_modes
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.score_test import FoundMode
from afm_scan_ros.core.fit.signals import correlation_length
from afm_scan_ros.core.fit.simulation import at_rest
from afm_scan_ros.core.fit.starts import (
    begun_at_rest,
    counted_whole,
    each_of_own_start,
    evidence_left_out,
)
from afm_scan_ros.core.fit.stretches import averaged
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
    other = with_rest(counted_whole(other), progress)
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


def read_after(fit: AxisFit) -> AxisFit:
    """Return a fit of records that were read after their drives' updates."""
    layout = evolve(fit.layout, reads_after=True)
    records = [one.read_after(layout.operator.half, layout.settings) for one in fit.records]
    return AxisFit(layout, records, fit.gain, fit.theta.copy(), fit.discrepancy, fit.scales)


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


def without_lags(fit: AxisFit) -> AxisFit:
    """Return a fit whose vibration is its gain alone."""
    layout = evolve(fit.layout, lags=np.array([fit.layout.settings.unseen_lag * fit.shortest]))
    lags = fit.layout.parts["lags"]
    theta = np.concatenate([fit.theta[: lags.start], [1.0], fit.theta[lags.stop :]])
    return AxisFit(layout, list(fit.records), fit.gain, theta, fit.discrepancy, fit.scales)


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


def with_sensor(fit: AxisFit, order: int, *, delayed: bool = False) -> AxisFit | None:
    """Return the fit with a sensor that lags as much as its vibration as read does.

    Its low-pass is of an ``order``, or none. Where the fit has no mode, one that the sensor hid is
    sought. Returns None where nothing lags, or where the sensor explains hardly anything of what is
    left while the operator is held.
    """
    settings, other = fit.layout.settings, _behind_sensor(fit, order, delayed=delayed)
    if other is None:
        return None
    enough = np.sqrt(1.0 - settings.mode_share) * fit.discrepancy
    hopeful = partial(_settled_while_hopeful, enough=enough if fit.layout.modes else np.inf)
    try:
        every = [hopeful(other)]
        if delayed:
            every += map(hopeful, by_whole_samples(every[0]))
        other = min(every, key=lambda each: each.discrepancy)
        if other.layout.modes == 0:
            every = [_refitted(other, each) for each in further_modes(other, settings.tried_modes)]
            other = min([other, *every], key=lambda each: each.discrepancy)
    except ScanError:
        return None
    return other if other.discrepancy < enough else None


def _behind_sensor(fit: AxisFit, order: int, *, delayed: bool) -> AxisFit | None:
    """Return the fit with a sensor in the place of its lags; None where nothing lags by as much."""
    read, unit = fit.layout.dynamics(fit.theta).read(), SensorModel(order, 1.0 if order else None)
    lag, of_unit = (-float(np.sum((b.weights / b.poles).real)) for b in (read, unit))
    corner = of_unit / max(lag, np.finfo(float).tiny)
    if lag <= 0.0 or corner > 0.5 / fit.shortest:
        return None
    laid = evolve(fit.layout, sensor_order=order, delayed=delayed)
    other = AxisFit(laid, list(fit.records), fit.gain, laid.start(), fit.discrepancy)
    for name in (*fit.layout.operator.parts, "map", "modes", "creep", "rest", "memory"):
        other.theta[laid.parts[name]] = fit.theta[fit.layout.parts[name]]
    other.theta[laid.parts["lags"].start] = 1.0 - sum(mode[2] for mode in laid.of_modes(fit.theta))
    delay = fit.layout.delay_of(fit.theta) + (0.0 if order else lag)
    chain = [np.log(corner)] if order else []
    other.theta[laid.parts["sensor"]] = [*chain, delay] if delayed else chain
    return other


def _settled_while_hopeful(fit: AxisFit, enough: float) -> AxisFit:
    """Return a fit, all but its operator settled as long as η may fall below what is ``enough``.

    The squares of the residuals may fall by ``decided`` times as much as the last step foresaw.
    """
    settings = fit.layout.settings
    for _ in range(settings.most_steps // settings.stage_steps):
        fit = read_late(fit)
        settle(fit, settings.stage_steps, LINEAR)
        falls = settings.decided * fit.remaining / fit.misfit(fit.theta)
        hopeless = fit.discrepancy * np.sqrt(max(0.0, 1.0 - falls)) > enough
        if hopeless or fit.converged or fit.stalled:
            break
    return read_late(fit)


def _refitted(fit: AxisFit, found: FoundMode) -> AxisFit:
    """Add a first mode to a fit, and refit all but its operator; return the result.

    Where that mode moves farther than lags lie apart, they and creep were placed for another, and
    it is added once more.
    """
    other = _held_with(fit, found)
    again = evolve(found, mode=other.layout.of_modes(other.theta)[0])
    apart = np.log(other.layout.lags[-1] / other.layout.lags[-2])
    if abs(np.log(again.mode[0] / found.mode[0])) > apart:
        other = min(other, _held_with(fit, again), key=lambda each: each.discrepancy)
    return other


def _held_with(fit: AxisFit, found: FoundMode) -> AxisFit:
    """Return a fit of the same records with a mode, after steps of all but its operator."""
    other = copy(fit)
    other.records = list(fit.records)
    add(other, found)
    settle(other, fit.layout.settings.most_steps, LINEAR)
    return other


def _without_creep(fit: AxisFit) -> AxisFit:
    """Return a fit without creep: that of plays may be what plays lack where rates differ too."""
    other = copy(fit)
    other.records, other.theta = list(fit.records), fit.theta.copy()
    other.theta[fit.layout.parts["creep"]] = 0.0
    groups = (*fit.layout.operator.parts, *VIBRATION, "rest", "memory")
    settle(other, fit.layout.settings.stage_steps, groups)
    return other


def with_one_state(fit: AxisFit) -> AxisFit:
    """Return the fit with the operator of one state that follows best the F of plays without creep.

    One state forgets where it began only little by little, at no turn of the drive, so each record
    that did not rest has a memory of its own. Where its path begins the plays do not say, for the
    offset of a record is free: all begin as from rest. It follows each turn of the drive, so that
    measured drives lose their noise. What vibrates is sought anew: it may have taken what plays
    cannot do.
    """
    fit = _without_creep(fit)
    layout, paths, rest = fit.layout, [], at_rest(fit.layout, fit.theta)
    quiet = [one.without_drive_noise(layout.operator.half, layout.settings) for one in fit.records]
    records, resting = each_of_own_start(quiet), begun_at_rest(fit, range(len(fit.records)))
    for record, simulation in zip(records, resting.simulated(resting.theta), strict=True):
        both = record.drive, simulation.effective - rest
        drive, output = (averaged(one, record.block)[record.used] for one in both)
        paths.append((drive, output))
    low = min(float((output - drive).min()) for drive, output in paths)
    high = max(float((output - drive).max()) for drive, output in paths)
    margin = (
        layout.settings.state_margin * (high - low) + np.finfo(float).eps * layout.operator.half
    )
    widths = low - margin, high + margin
    operator = OneState(layout.operator.lower, layout.operator.upper, widths, layout.settings)
    linear = fit.theta[layout.parts["lags"].start : layout.parts["rest"].start]
    begun = np.array([output[0] - drive[0] for drive, output in paths])
    memory = begun[[not one.rested for one in records]]
    tail = np.concatenate([linear, np.zeros(operator.rests), memory])
    starts = [np.concatenate([one, tail]) for one in operator.started(paths)]
    laid = evolve(layout, operator=operator, unknown_starts=len(memory))
    other = AxisFit(laid, records, fit.gain, starts[0], fit.discrepancy)
    other.theta = min(starts, key=other.objective)
    other.lay_out(evolve(other.layout, modes=0))
    other.weigh()
    while (other.layout.modes == 0 and add_first_mode(other)) or add_mode(other):
        settle(other, layout.settings.most_steps, LINEAR)
    return other
