"""The records of one axis → its fit: the order in which parameters are released."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.estimator import VIBRATION, AxisFit
from afm_scan_ros.core.fit.modes import best_mode
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import layout_of
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS, FitSettings
from afm_scan_ros.core.fit.signals import averaged, signals_of
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import ProgressCallback


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
        Its operator is the one of two, plays or one state, of the greater evidence.

    Raises
    ------
    InputError
        Where no record moves, and for a record whose memory is never known.
    ScanError
        Where the fit diverges.
    """
    fit = _first(records, axis, settings)
    for record in fit.records:
        if record.first:
            progress(
                f"{record.name}: its memory is known from {record.first * record.period:.3g} s"
            )
    fit.weigh()
    progress("looking for modes")
    if _add_mode(fit, settings.dominant_share):
        fit.settle(settings.most_steps, VIBRATION)
    progress("fitting the hysteresis by plays")
    _fit_plays(fit)
    progress("fitting the hysteresis by one state")
    fit = _better(fit, with_one_state(fit), progress)
    while True:
        fit.settle(settings.most_steps, searching=True)
        if fit.find_tones():
            continue
        if fit.layout.modes == settings.most_modes or not _add_mode(fit, settings.mode_share):
            break
        progress("fitting a further mode")
        fit.settle(settings.most_steps, VIBRATION)
    if fit.remaining > settings.converged:
        progress(f"not converged: {fit.remaining:.3g} nat may remain")
    return fit


def _fit_plays(fit: AxisFit) -> None:
    """Fit the plays, the modes that they leave, and tones; the map behind the plays comes last."""
    settings = fit.layout.settings
    by_plays = (*fit.layout.operator.parts, *VIBRATION, "creep")
    fit.settle(settings.stage_steps, by_plays)
    fit.find_tones()
    needed = settings.mode_share if fit.layout.modes == 0 else settings.dominant_share
    while fit.layout.modes < settings.most_modes and _add_mode(fit, needed):
        fit.settle(settings.most_steps, VIBRATION)
        fit.settle(settings.stage_steps, by_plays)
        fit.find_tones()
        needed = settings.dominant_share
    fit.settle(settings.stage_steps)
    fit.find_tones()


def _better(plays: AxisFit, other: AxisFit, progress: ProgressCallback) -> AxisFit:
    """Return the fit of the greater evidence; one state that diverges is none of the scanner's."""
    first, most = plays.layout.settings.stage_steps, plays.layout.settings.most_steps
    plays.settle(first)
    plays.settle(most, searching=True)
    try:
        other.settle(first)
        other.settle(most, searching=True)
        margin = plays.evidence() - other.evidence()
    except ScanError as error:
        progress(f"one state: {error}")
        return plays
    found, chosen = (plays, "plays") if margin > 0.0 else (other, "one state")
    progress(f"the hysteresis is of {chosen}, by {abs(margin):.3g} nat")
    return found


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
    """Add the mode that explains most, where it explains enough; the first one places the lags.

    Before any other parameter, it also says what the gain is.
    """
    settings, layout = fit.layout.settings, fit.layout
    found = best_mode(fit)
    if found.explained < max(settings.mode_chance, share * fit.misfit(fit.theta)):
        return False
    if np.array_equal(fit.theta, layout.start()):
        fit.gain *= found.gain
    if fit.layout.modes == 0:
        longest = max(len(one.drive) * one.period for one in fit.records)
        shortest = min(one.period for one in fit.records)
        fit.lay_out(layout_of(fit.layout.operator, longest, shortest, settings, found.mode[0]))
    fit.add(found.mode)
    return True


def with_one_state(fit: AxisFit) -> AxisFit:
    """Return the fit with the operator of one state that follows its F best."""
    layout, paths = fit.layout, []
    for record, simulation in zip(fit.records, fit.simulated(fit.theta), strict=True):
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
