"""The records of one axis → its fit: the order in which parameters are released."""

from collections.abc import Sequence
from copy import copy

import numpy as np
from attrs import evolve

from afm_scan_ros.core.effects.sensor import led
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.alternatives import (
    better,
    with_rest,
    with_told_lags,
    with_told_reading,
    without_lead,
)
from afm_scan_ros.core.fit.descent import LINEAR, VIBRATION, settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.likeness import refuse_unlike
from afm_scan_ros.core.fit.model_of_fit import lost_by, model_of
from afm_scan_ros.core.fit.modes import add_first_mode, add_mode
from afm_scan_ros.core.fit.parameters import layout_of
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.signals import signals_of, steps_read_after
from afm_scan_ros.core.fit.tones import free_tones
from afm_scan_ros.core.intersample import held_voltages
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, ProgressCallback


def fit_axis(
    records: Sequence[Record],
    axis: str,
    progress: ProgressCallback = lambda _: None,
    *,
    linear: bool = False,
) -> AxisFit:
    """Fit all parameters of an axis to all of its records; none needs a kind.

    The operator of a ``linear`` scanner stays a straight line. That of others is plays, unless
    these leave more than noise and one state has clearly the greater evidence. Raises InputError
    where no record moves, and for a record that is too short, of another scanner than the others,
    or has its columns exchanged, and ScanError where the fit diverges.
    """
    settings = DEFAULT_SETTINGS
    fit = started(records, axis, settings, linear=linear)
    for record in fit.records:
        if record.first:
            known = record.first * record.period
            progress(f"{record.name}: its memory is known from {known:.3g} s")
    fit.weigh()
    progress("looking for modes")
    if found := add_first_mode(fit):
        fit.gain *= found.gain
        settle(fit, settings.most_steps, VIBRATION)
    refuse_unlike(fit)
    fit = with_told_reading(fit, progress)
    if linear:
        return _of_linear(fit, progress)
    progress("fitting the hysteresis by plays")
    fit = better(_of_plays(fit, progress), progress)
    progress("fitting all effects together")
    while True:
        settle(fit, settings.most_steps, searching=True)
        if free_tones(fit):
            continue
        if not add_mode(fit):
            break
        progress("fitting a further mode")
        settle(fit, settings.most_steps, VIBRATION)
    fit = with_told_lags(without_lead(fit, progress), progress)
    if len(fit.layout.lacking(fit.theta)[1]):
        progress("holding the hysteresis to its conditions")
        fit = _held_to_growth(fit)
    if not fit.converged:
        progress(f"not converged: {fit.remaining:.3g} nat may remain")
    return fit


def _of_linear(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Fit modes, lags, creep and tones to what a straight line leaves."""
    while True:
        settle(fit, fit.layout.settings.most_steps, LINEAR, searching=True)
        if not (free_tones(fit) or add_mode(fit)):
            break
        progress("fitting a further mode")
    fit = without_lead(fit, progress, LINEAR)
    if not fit.converged:
        progress(f"not converged: {fit.remaining:.3g} nat may remain")
    return fit


def _of_plays(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Fit the plays, the modes that they leave, and tones; the map behind the plays comes last.

    Whether records began at rest is asked before where their memory is estimated, for a start that
    is wrong hides all else, and again behind the map, where less is left to hide it.
    """
    settings = fit.layout.settings
    by_plays = (*fit.layout.operator.parts, *LINEAR, "rest", "memory")
    settle(fit, settings.stage_steps, by_plays)
    free_tones(fit)
    while add_mode(fit):
        settle(fit, settings.stage_steps, by_plays)
        free_tones(fit)
    if fit.layout.unknown_starts:
        fit = with_rest(fit, progress, by_plays)
    progress("fitting the map behind the hysteresis")
    settle(fit, settings.stage_steps)
    free_tones(fit)
    settle(fit, settings.stage_steps, searching=True)
    free_tones(fit)
    return with_rest(fit, progress)


def _held_to_growth(fit: AxisFit) -> AxisFit:
    """Return a fit whose surface grows, unless that costs more than mixing it with a line does."""
    held = copy(fit)
    held.records, held.grows = list(fit.records), True
    settle(held, held.layout.settings.most_steps)
    lost = lost_by(model_of(fit), fit)
    return held if held.discrepancy**2 < fit.discrepancy**2 + lost else fit


def started(
    records: Sequence[Record], axis: str, settings: FitSettings, *, linear: bool = False
) -> AxisFit:
    """Return a fit of no hysteresis, creep or vibration, and the gain of a straight line.

    A ``linear`` scanner remembers no drive before its records but by its lags and creep.
    """
    given = [record.axis(axis) for record in records if axis in record.axes]
    ahead = [steps_read_after(one, settings) for one in given]
    voltages = [
        led(one.drive[:, 0]) if after else one.drive[:, 0]
        for one, after in zip(given, ahead, strict=True)
    ]
    pairs = zip(voltages, given, strict=True)
    drives = [held_voltages(drive, one.intersample) for drive, one in pairs]
    operator = Plays(*_range_of(drives, settings), settings)
    if operator.half == 0.0:
        raise InputError(f"no record moves {axis}: give one whose drive changes")
    signals = [
        evolve(signals_of(one, drive, operator.half, settings, remembers=not linear), ahead=after)
        for one, drive, after in zip(given, drives, ahead, strict=True)
    ]
    begun = [k for k, one in enumerate(signals) if not (linear or one.rested or one.first)]
    for place, k in enumerate(begun):
        signals[k] = evolve(signals[k], unknown=place)
    longest = max(len(one.drive) * one.period for one in signals)
    shortest = min(one.sampled for one in signals)
    layout = layout_of(operator, longest, shortest, settings)
    layout = evolve(layout, unknown_starts=len(begun), linear=linear)
    driven = np.concatenate([one.drive - one.drive.mean() for one in signals])
    moved = np.concatenate([one.displacement - one.displacement.mean() for one in signals])
    gain = float(driven @ moved / (driven @ driven))
    return AxisFit(layout, signals, gain, layout.start())


def _range_of(drives: Sequence[Array], settings: FitSettings) -> tuple[float, float]:
    """Range (V) of all drives, and of rest at 0 V where that is near."""
    low, high = min(map(np.min, drives), default=0.0), max(map(np.max, drives), default=0.0)
    margin = settings.rest_margin * (high - low)
    near = low <= margin and high >= -margin
    return (min(low, 0.0), max(high, 0.0)) if near else (low, high)
