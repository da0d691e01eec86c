"""Fits of the same records in another way: other starts, reading, sensor or operator."""

from collections.abc import Collection, Iterator
from copy import copy
from functools import partial
from itertools import count

import numpy as np
from attrs import evolve

from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.fit.descent import LINEAR, VIBRATION, settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.modes import add, add_first_mode, add_mode, further_modes
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.score_test import FoundMode
from afm_scan_ros.core.fit.simulation import at_rest
from afm_scan_ros.core.fit.stretches import averaged
from afm_scan_ros.core.types import Array


def begun_at_rest(fit: AxisFit, places: Collection[int]) -> AxisFit:
    """Return a fit in which some records rested before their first sample, at 0 V.

    They remember nothing then, no creep goes on in them, and they count from their first sample on.
    """
    records, memories = [], [np.zeros(0)]
    for k, record in enumerate(fit.records):
        changed = record
        if k in places:
            changed = evolve(record, rested=True, unknown=None, first=0)
        elif record.unknown is not None:
            changed = evolve(record, unknown=len(memories) - 1)
            memories.append(fit.theta[fit.layout.memory_part(record)])
        records.append(changed)
    layout = evolve(fit.layout, unknown_starts=len(memories) - 1)
    theta = np.concatenate([fit.theta[: layout.parts["memory"].start], *memories])
    theta[layout.parts["rest"]] = rest_of(fit)
    return AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)


def rest_of(fit: AxisFit) -> Array:
    """Where a fit's operator lies at depolarised rest, in θ: as records, or else itself, tell."""
    if any(one.rested for one in fit.records):
        return fit.theta[fit.layout.parts["rest"]]
    return fit.layout.operator.depolarised(fit.layout.of_operator(fit.theta))


def evidence_left_out(fit: AxisFit) -> float:
    """Evidence (nat) of the samples that are left out as what came before them is unknown.

    It is the greatest that they can have: the model leaves no more of them than of the others, and
    the memory has the volume that these samples leave of what is expected of it.
    """
    early = [k for k, one in enumerate(fit.records) if one.first]
    places = {k: place for place, k in enumerate(early)}
    records = [evolve(one, first=0, unknown=places.get(k)) for k, one in enumerate(fit.records)]
    operator = fit.layout.operator
    layout = evolve(fit.layout, unknown_starts=len(early))
    kept = fit.theta[: layout.parts["memory"].start]
    theta = np.concatenate([kept, np.zeros(len(early) * operator.unknowns)])
    whole = AxisFit(layout, records, fit.gain, theta, fit.discrepancy, fit.scales)
    memory = layout.parts["memory"]
    matrix = whole.normal(with_operator=False)[0][memory, memory]
    expected = np.tile(operator.expected_memory(), len(early))
    volume = np.linalg.slogdet(np.eye(len(expected)) + expected[:, np.newaxis] * matrix * expected)
    lost = 0.0
    for all_of_it, one, left in zip(records, fit.records, fit.residuals(), strict=True):
        variance = fit.variance(one)
        each = np.log(variance) + float(np.mean(left**2)) / variance
        lost += (len(all_of_it.mean) - len(one.mean)) * each
    return float(-0.5 * (lost + volume[1]))


def read_late(fit: AxisFit) -> AxisFit:
    """Return a fit whose drives are late by whole samples, the nearest ones to its delay.

    Derivatives do not see what is left of that, which may be half a sample more or less.
    """
    delay, layout, settings = fit.layout.delay_of(fit.theta), fit.layout, fit.layout.settings
    samples = [round(delay / one.period) for one in fit.records]
    if samples == [one.late for one in fit.records]:
        return fit
    pairs = list(zip(fit.records, samples, strict=True))
    records = [one.read_late(late, layout.operator.half, settings) for one, late in pairs]
    least = max(0.0, *((late - 1) * one.period for one, late in pairs))
    layout = evolve(layout, least_delay=least)
    return AxisFit(layout, records, fit.gain, fit.theta, fit.discrepancy, fit.scales)


def by_whole_samples(fit: AxisFit) -> Iterator[AxisFit]:
    """Yield the fit with its delay at the samples of the fastest record around it, as of buffers.

    At such a delay the response to steps of a drive has a corner, which hides it from descents.
    """
    period, delay = fit.shortest, fit.layout.delay_of(fit.theta)
    for samples in (np.floor(delay / period), np.ceil(delay / period)):
        theta = fit.theta.copy()
        theta[fit.layout.delay_place] = samples * period
        whole = AxisFit(fit.layout, list(fit.records), fit.gain, theta, fit.discrepancy, fit.scales)
        yield read_late(whole)


def read_after(fit: AxisFit) -> AxisFit:
    """Return a fit of records that were read after their drives' updates."""
    layout = evolve(fit.layout, reads_after=True)
    records = [one.read_after(layout.operator.half, layout.settings) for one in fit.records]
    return AxisFit(layout, records, fit.gain, fit.theta.copy(), fit.discrepancy, fit.scales)


def without_lags(fit: AxisFit) -> AxisFit:
    """Return a fit whose vibration is its gain alone."""
    layout = evolve(fit.layout, lags=np.array([fit.layout.settings.unseen_lag * fit.shortest]))
    lags = fit.layout.parts["lags"]
    theta = np.concatenate([fit.theta[: lags.start], [1.0], fit.theta[lags.stop :]])
    return AxisFit(layout, list(fit.records), fit.gain, theta, fit.discrepancy, fit.scales)


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
    places, resting = count(), begun_at_rest(fit, range(len(fit.records)))
    records = [one if one.rested else evolve(one, unknown=next(places)) for one in quiet]
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
    theta = np.concatenate([operator.started(paths), tail])
    laid = evolve(layout, operator=operator, unknown_starts=len(memory))
    other = AxisFit(laid, records, fit.gain, theta, fit.discrepancy)
    other.lay_out(evolve(other.layout, modes=0))
    other.weigh()
    while (other.layout.modes == 0 and add_first_mode(other)) or add_mode(other):
        settle(other, layout.settings.most_steps, LINEAR)
    return other
