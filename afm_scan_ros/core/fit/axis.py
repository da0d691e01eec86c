"""The records of one axis → its model: the order in which a fit releases what it fits."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve
from scipy.optimize import nnls

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap, Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.estimator import LINEAR, AxisFit
from afm_scan_ros.core.fit.modes import best_mode
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import layout_of
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.signals import averaged, signals_of
from afm_scan_ros.core.model import (
    AxisModel,
    HysteresisModel,
)
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
        Is called with what is being fitted.

    Returns
    -------
    AxisFit
        Its operator is the one of two, plays or one state, of the greater evidence.

    Raises
    ------
    InputError
        Where no record moves.
    """
    fit = _first(records, axis, settings)
    fit.weigh()
    progress("looking for modes")
    while fit.layout.modes < settings.most_modes and _add_mode(fit, settings.dominant_share):
        fit.settle(settings.trial_steps, LINEAR)
    progress("fitting the hysteresis by plays")
    by_plays = (*fit.layout.operator.parts, *LINEAR, "creep")
    fit.settle(settings.trial_steps, by_plays)
    if fit.layout.modes == 0 and _add_mode(fit, settings.mode_share):
        fit.settle(settings.trial_steps, LINEAR)
        fit.settle(settings.trial_steps, by_plays)
    fit.find_tones()
    progress("fitting the hysteresis by one state")
    other = with_one_state(fit)
    for each in (fit, other):
        each.settle(settings.trial_steps)
        each.settle(settings.most_steps, searching=True)
    margin = fit.evidence() - other.evidence()
    fit, chosen = (fit, "plays") if margin > 0.0 else (other, "one state")
    progress(f"the hysteresis is of {chosen}, by {abs(margin):.3g} nat")
    while fit.layout.modes < settings.most_modes and _add_mode(fit, settings.mode_share):
        progress("fitting a further mode")
        fit.settle(settings.trial_steps, LINEAR)
        fit.settle(settings.most_steps, searching=True)
    return fit


def _first(records: Sequence[Record], axis: str, settings: FitSettings) -> AxisFit:
    """No hysteresis, creep or vibration, and the gain of a straight line."""
    given = [record.axis(axis) for record in records if axis in record.axes]
    drives = [record.drive[:, 0] for record in given]
    ends = min(map(np.min, drives), default=0.0), max(map(np.max, drives), default=0.0)
    operator = Plays(*ends, settings)
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
    longest = max(len(one.drive) * one.period for one in signals)
    layout = layout_of(operator, longest, min(one.period for one in signals), settings)
    driven = np.concatenate([one.drive - one.drive.mean() for one in signals])
    moved = np.concatenate([one.displacement - one.displacement.mean() for one in signals])
    gain = float(driven @ moved / (driven @ driven))
    return AxisFit(layout, signals, gain, layout.start())


def _add_mode(fit: AxisFit, share: float) -> bool:
    """Add the mode that explains most, where it explains enough; the first one places the lags."""
    settings = fit.layout.settings
    gain, mode = best_mode(fit)
    if gain < max(settings.mode_chance, share * fit.misfit()):
        return False
    if fit.layout.modes == 0:
        longest = max(len(one.drive) * one.period for one in fit.records)
        shortest = min(one.period for one in fit.records)
        fit.lay_out(layout_of(fit.layout.operator, longest, shortest, settings, mode[0]))
    fit.add(mode)
    return True


def with_one_state(fit: AxisFit) -> AxisFit:
    """Return the fit with the operator of one state that follows its F best."""
    layout, paths = fit.layout, []
    for record, simulation in zip(fit.records, fit.simulated(), strict=True):
        output = simulation.effective - simulation.settled
        paths.append((averaged(record.drive, record.block), averaged(output, record.block)))
    low = min(float((output - drive).min()) for drive, output in paths)
    high = max(float((output - drive).max()) for drive, output in paths)
    margin = (
        layout.settings.state_margin * (high - low) + np.finfo(float).eps * layout.operator.half
    )
    widths = low - margin, high + margin
    operator = OneState(layout.operator.lower, layout.operator.upper, widths, layout.settings)
    linear = fit.theta[layout.parts["lags"].start :]
    starts = [np.concatenate([one, linear]) for one in operator.started(paths)]
    other = AxisFit(
        evolve(layout, operator=operator), list(fit.records), fit.gain, starts[0], fit.discrepancy
    )
    other.theta = min(starts, key=other.objective)
    other.weigh()
    return other


def model_of(fit: AxisFit) -> AxisModel:
    """Return the model that a fit has found, with F = 0 at depolarised rest.

    Raises InputError where the operator found does not grow everywhere, so that it has no inverse.
    """
    layout, operator = fit.layout, fit.layout.operator
    dynamics, theta = layout.dynamics(fit.theta), layout.of_operator(fit.theta)
    if isinstance(operator, OneState):
        slopes = operator.slopes(theta)
        direct = direct_of(nearest_surface(slopes, layout.settings), None, layout.settings)
        hysteresis = HysteresisModel(slopes, direct)
    elif isinstance(operator, Plays):
        surface, mapped = _of_plays(operator, theta, layout.map_of(fit.theta))
        hysteresis = HysteresisModel(surface, direct_of(surface, mapped, layout.settings), mapped)
    return AxisModel(hysteresis, dynamics.vibration(fit.gain), dynamics.creep())


def _of_plays(
    operator: Plays, theta: Array, mapped: OutputMap | None
) -> tuple[EverettSurface, OutputMap | None]:
    """Surface of plays and the map behind it, moved so that F = 0 at depolarised rest."""
    surface = operator.surface(theta)
    if mapped is None:
        return surface, None
    rest = operator.output(theta, np.zeros(1), rested=True)
    shift = float(mapped.output(rest)[0])
    mapped = evolve(mapped, lower=mapped.lower - shift, upper=mapped.upper - shift)
    return evolve(surface, offset=surface.offset + float(rest[0]) - shift), mapped


def direct_of(
    surface: EverettSurface, mapped: OutputMap | None, settings: FitSettings
) -> EverettSurface:
    """Return the direct inverse's surface, from the exact inverse of a surface and its map.

    U(alpha, beta) is half of what the drive falls by as F falls from alpha to beta, after it has
    risen from the least F. Croft, Shed and Devasia (2001), Eq. 16, from F to u.
    """
    behind = () if mapped is None else (mapped,)
    whole = Cascade((Preisach(surface), *behind))
    ends = np.array([surface.upper, surface.lower])
    saturated, (_, low) = whole.apply(whole.at_rest(), ends)
    high = whole.apply(saturated, ends[:1])[1][0]
    levels = np.linspace(low, high, settings.direct_levels)
    values = np.zeros((settings.direct_levels, settings.direct_levels))
    for row in range(1, settings.direct_levels):
        there_and_back = np.concatenate([levels[row : row + 1], levels[:row][::-1]])
        drive = whole.invert(saturated, there_and_back)[1]
        values[row, :row] = 0.5 * (drive[0] - drive[:0:-1])
    return EverettSurface(float(low), float(high), values, surface.lower)


def nearest_surface(slopes: DuhemSlopes, settings: FitSettings) -> EverettSurface:
    """Return the surface of plays that follow the reversal curves of one state best."""
    turns = np.linspace(slopes.upper, slopes.lower, settings.direct_levels)[1:]
    ends = np.full_like(turns, slopes.upper)
    corners = np.concatenate([[0.0], ends[:1], np.column_stack([turns, ends]).ravel()])
    places = np.arange(len(corners)) * settings.direct_levels
    drive = np.interp(np.arange(places[-1] + 1), places, corners)
    model, plays = Duhem(slopes), Plays(slopes.lower, slopes.upper, settings)
    output = model.apply(model.at_rest(), drive)[1]
    columns = plays.columns(plays.unbent(), drive, 1, rested=True)[:, : len(plays.thresholds)]
    density, _ = nnls((columns - columns.mean(axis=0)).astype(float), output - output.mean())
    theta = np.zeros_like(plays.unbent())
    theta[: len(density)] = density
    theta[0] = max(theta[0], settings.least_slope)
    return plays.surface(theta)
