"""The records of one axis → its fit: the order in which parameters are released."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from attrs import evolve

from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.descent import VIBRATION, settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.likeness import refuse_unlike
from afm_scan_ros.core.fit.modes import FoundMode, first_mode, further_mode
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import layout_of
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.sensitivity import at_rest
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.signals import averaged, correlation_length, in_step, signals_of
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, ProgressCallback


def fit_axis(
    records: Sequence[Record],
    axis: str,
    settings: FitSettings = DEFAULT_SETTINGS,
    progress: ProgressCallback = lambda _: None,
) -> AxisFit:
    """Fit all parameters of an axis to all of its records; none needs a kind.

    Parameters
    ----------
    records
        Records that hold the axis, at least one of which moves.
    axis
        Its name.
    settings
        What is resolved, expected, and taken for significant.
    progress
        Is called with what is being fitted, and with what of a record does not count.

    Returns
    -------
    AxisFit
        Its operator is plays, unless these leave more than noise and one state has clearly the
        greater evidence.

    Raises
    ------
    InputError
        Where no record moves, and for a record that is too short, of another scanner than the
        others, or has its columns exchanged.
    ScanError
        Where the fit diverges.
    """
    fit = started(records, axis, settings)
    for record in fit.records:
        if record.first:
            known = record.first * record.period
            progress(f"{record.name}: its memory is known from {known:.3g} s")
    fit.weigh()
    progress("looking for modes")
    if found := _first_mode(fit):
        fit.gain *= found.gain
        settle(fit, settings.most_steps, VIBRATION)
    refuse_unlike(fit)
    progress("fitting the hysteresis by plays")
    _fit_plays(fit)
    fit = _better(fit, progress)
    while True:
        settle(fit, settings.most_steps, searching=True)
        if fit.find_tones():
            continue
        if not _add_mode(fit):
            break
        progress("fitting a further mode")
        settle(fit, settings.most_steps, VIBRATION)
    if len(fit.layout.lacking(fit.theta)[1]):
        progress("holding the surface of the hysteresis to growth")
        fit.grows = True
        settle(fit, settings.most_steps)
    if not fit.converged:
        progress(f"not converged: {fit.remaining:.3g} nat may remain")
    return fit


def _fit_plays(fit: AxisFit) -> None:
    """Fit the plays, the modes that they leave, and tones; the map behind the plays comes last."""
    settings = fit.layout.settings
    by_plays = (*fit.layout.operator.parts, *VIBRATION, "creep", "memory")
    settle(fit, settings.stage_steps, by_plays)
    fit.find_tones()
    while _add_mode(fit):
        settle(fit, settings.stage_steps, by_plays)
        fit.find_tones()
    settle(fit, settings.stage_steps)
    fit.find_tones()


def _better(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return the fit by plays, the paper's operator, or by what has clearly the greater evidence.

    That is an operator of one state, a sensor with a low-pass of its own, or both. Nothing else is
    tried where hardly more than the sensor's noise is left.
    """
    fit = _with_any_sensor(fit, progress)
    if fit.sufficient:
        progress("hardly more than noise is left")
        return fit
    progress("fitting the hysteresis by one state")
    other = _preferred(fit, partial(with_one_state, fit), progress, "one state")
    if other is fit:
        return fit
    while _add_mode(other):
        settle(other, other.layout.settings.most_steps, searching=True)
    return _with_any_sensor(other, progress)


def _with_any_sensor(fit: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return a fit, or one with a low-pass of the sensor that has clearly the greater evidence.

    A steeper one is tried where the last was better, and not enough. None is where only noise is
    left: what a low-pass leaves of slow records is slight, and large at other rates.
    """
    for order in range(2, fit.layout.settings.steepest_sensor + 1, 2):
        if fit.at_noise:
            break
        before, name = fit, f"a sensor's low-pass of order {order}"
        fit = _preferred(fit, partial(with_sensor, fit, order), progress, name)
        if fit is before:
            break
    return fit


def _preferred(
    fit: AxisFit,
    changed: Callable[[], AxisFit | None],
    progress: ProgressCallback,
    name: str,
) -> AxisFit:
    """Return a fit, or a changed one that has clearly the greater evidence.

    The evidence is that of independent residuals, so the lead is divided by their correlation
    length, and has to be as clear as a mode's. A fit that diverges is none of the scanner's.
    """
    try:
        other = changed()
        if other is None:
            return fit
        lead = -_margin(fit, other)
        if lead > 0.0:
            settle(other, other.layout.settings.most_steps, searching=True)
            lead = other.evidence() - fit.evidence()
    except ScanError as error:
        progress(f"{name}: {error}")
        return fit
    lead /= max(map(correlation_length, other.residuals(other.simulated(other.theta))))
    progress(f"{name} has {lead:.3g} nat more evidence")
    return other if lead > other.layout.settings.mode_chance else fit


def _margin(one: AxisFit, other: AxisFit) -> float:
    """Evidence for one fit over another, nat.

    Both take steps in turn until they converge, or the worse one would hardly make up.
    """
    settings, margin = one.layout.settings, 0.0
    for _ in range(settings.most_steps // settings.stage_steps):
        for each in (one, other):
            settle(each, settings.stage_steps, searching=True)
        margin = one.evidence() - other.evidence()
        worse = other if margin > 0.0 else one
        decided = abs(margin) > settings.decided * worse.remaining
        if decided or (one.converged and other.converged):
            break
    return margin


def started(records: Sequence[Record], axis: str, settings: FitSettings) -> AxisFit:
    """Return a fit of no hysteresis, creep or vibration, and the gain of a straight line."""
    given = [record.axis(axis) for record in records if axis in record.axes]
    drives = [in_step(one.drive[:, 0], one.displacement[:, 0], settings) for one in given]
    operator = Plays(*_range_of(drives, settings), settings)
    if operator.half == 0.0:
        raise InputError(f"no record moves {axis}: give one whose drive changes")
    signals = [
        signals_of(
            record.name,
            drive,
            record.displacement[:, 0],
            record.sample_period,
            depolarised=record.depolarised,
            settings=settings,
        )
        for record, drive in zip(given, drives, strict=True)
    ]
    begun = [k for k, one in enumerate(signals) if not one.rested and not one.first]
    for place, k in enumerate(begun):
        signals[k] = evolve(signals[k], unknown=place)
    longest = max(len(one.drive) * one.period for one in signals)
    shortest = min(one.period for one in signals)
    layout = evolve(layout_of(operator, longest, shortest, settings), unknown_starts=len(begun))
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


def _first_mode(fit: AxisFit) -> FoundMode | None:
    """Add the mode of the largest residuals, where they are about it rather than of the loops."""
    found = first_mode(fit)
    if found is not None:
        _add(fit, found)
    return found


def _add_mode(fit: AxisFit) -> bool:
    """Add the mode that explains most, where there is one and room for it.

    Once there is a mode, none is sought where hardly more than noise is left.
    """
    enough = fit.layout.modes > 0 and fit.sufficient
    if enough or fit.layout.modes == fit.layout.settings.most_modes:
        return False
    found = further_mode(fit)
    if found is None:
        return False
    _add(fit, found)
    return True


def _add(fit: AxisFit, found: FoundMode) -> None:
    """Add a mode; the first one places the lags."""
    if fit.layout.modes == 0:
        longest = max(len(one.drive) * one.period for one in fit.records)
        shortest = min(one.period for one in fit.records)
        settings, omega = fit.layout.settings, found.mode[0]
        laid = layout_of(fit.layout.operator, longest, shortest, settings, omega)
        now = fit.layout
        fit.lay_out(evolve(laid, unknown_starts=now.unknown_starts, sensor_order=now.sensor_order))
    fit.add(found.mode)


def with_sensor(fit: AxisFit, order: int) -> AxisFit | None:
    """Return the fit with a sensor's low-pass that lags as much as its vibration as read does.

    What vibrates is sought anew. Returns None where nothing lags, or where the low-pass explains
    hardly anything of what is left while the operator is held.
    """
    settings, read = fit.layout.settings, fit.layout.dynamics(fit.theta).read()
    unit = SensorModel(order, 1.0)
    lag, of_unit = (-float(np.sum((b.weights / b.poles).real)) for b in (read, unit))
    corner = of_unit / max(lag, np.finfo(float).tiny)
    if corner > 0.5 / min(one.period for one in fit.records):
        return None
    laid = evolve(fit.layout, modes=0, sensor_order=order)
    other = AxisFit(laid, list(fit.records), fit.gain, laid.start(), fit.discrepancy)
    for name in (*fit.layout.operator.parts, "map", "creep", "memory"):
        other.theta[laid.parts[name]] = fit.theta[fit.layout.parts[name]]
    other.theta[laid.parts["sensor"]] = np.log(corner)
    other.weigh()
    for _ in range(1 + max(fit.layout.modes, 1)):
        settle(other, settings.stage_steps, (*VIBRATION, "creep"))
        if not _add_mode(other):
            break
    left = (other.discrepancy / fit.discrepancy) ** 2
    return other if left < 1.0 - settings.mode_share else None


def with_one_state(fit: AxisFit) -> AxisFit:
    """Return the fit with the operator of one state that follows its F best.

    What vibrates is sought anew: it may have taken what plays cannot do.
    """
    layout, paths, rest = fit.layout, [], at_rest(fit.layout, fit.theta)
    for record, simulation in zip(fit.records, fit.simulated(fit.theta), strict=True):
        output = simulation.effective - rest
        paths.append((averaged(record.drive, record.block), averaged(output, record.block)))
    low = min(float((output - drive).min()) for drive, output in paths)
    high = max(float((output - drive).max()) for drive, output in paths)
    margin = (
        layout.settings.state_margin * (high - low) + np.finfo(float).eps * layout.operator.half
    )
    widths = low - margin, high + margin
    operator = OneState(layout.operator.lower, layout.operator.upper, widths, layout.settings)
    linear = fit.theta[layout.parts["lags"].start : layout.parts["memory"].start]
    begun = np.array([output[0] - drive[0] for drive, output in paths])
    memory = begun[[one.unknown is not None for one in fit.records]]
    starts = [np.concatenate([one, linear, memory]) for one in operator.started(paths)]
    other = AxisFit(
        evolve(layout, operator=operator), list(fit.records), fit.gain, starts[0], fit.discrepancy
    )
    other.theta = min(starts, key=other.objective)
    other.lay_out(evolve(other.layout, modes=0))
    other.weigh()
    while (other.layout.modes == 0 and _first_mode(other)) or _add_mode(other):
        settle(other, layout.settings.most_steps, (*VIBRATION, "creep"))
    return other
