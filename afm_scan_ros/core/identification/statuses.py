"""How each effect of an axis is known, and other descriptions of its records that fit as well.

The scatter of a frequency record shows how far its figures would lie from another record's, not how
far they lie from the scanner's: a mode beyond the band bends a model without it, and loops smaller
than a cell of the Everett surface are taken for the vibration's. Neither shows in the residual, for
the fit bends with them. Both show when the records are described anew: with one mode more, with a
surface twice as fine, with both. The intervals span these descriptions, and beyond them the
scatter's own half-widths.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from attrs import evolve

from afm_scan_ros.core.fit.told import swings
from afm_scan_ros.core.identification.alternating import (
    REFERENCE_GAIN,
    AxisRecord,
    Converged,
    response_to,
)
from afm_scan_ros.core.identification.creep.fit import CreepFit
from afm_scan_ros.core.identification.hysteresis.duhem_fit import fit_duhem
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import fit_surface
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    LINES_PER_POLE,
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.model import EffectStatus, Range, closed
from afm_scan_ros.core.types import Array

FINEST = 241
"""Levels beyond which no finer surface is tried."""
COARSER = 8
"""Cells of the slopes of another Duhem operator."""


def alternatives(converged: Converged) -> Mapping[str, RationalFit]:
    """Fit the vibration under the other descriptions, named by what differs."""
    fitted, period = converged.turn.vibration, converged.turns.frequency.sample_period
    order, delay = fitted.order, fitted.model.delay
    more = Order(order.poles + 2, order.zeros + 2)
    responses = {"": converged.turn.response, **_otherwise(converged)}
    found = {}
    for other, response in responses.items():
        early = response.advanced(delay).up_to(fitted.band[1])
        for each in (order, more):
            words = [str(each)] * (each != order) + [other] * (other != "")
            if words and len(early.omega) >= LINES_PER_POLE * each.poles:
                fit = fit_rational(early, period, REFERENCE_GAIN, each)
                found[", ".join(words)] = fit
    return found


def _otherwise(converged: Converged) -> Mapping[str, FrequencyResponse]:
    """Response to F of a surface twice as fine, by its name; none where that is too fine.

    Of a Duhem operator it is that to F of slopes on fewer cells.
    """
    turns, effective = converged.turns, converged.turn.effective
    drive, curves = turns.hysteresis.drive, turns.curves
    if converged.slopes is not None:
        other = fit_duhem(drive[: curves.end], effective[: curves.end], COARSER)
        return {f"{COARSER} cells": response_to(other.operator, turns.frequency)}
    fitted = converged.everett.forward
    grid = fitted.grid.finer
    if grid.size > FINEST:
        return {}
    found = curves.of(drive, effective)
    finer = fit_surface(found, grid, fitted.strength, terms=fitted.terms).raised()
    return {f"{grid.size} levels": response_to(finer.operator, turns.frequency)}


def spanning(fit: RationalFit, others: Iterable[RationalFit]) -> RationalFit:
    """Return the fit with intervals that span what the others find, and the scatter beyond.

    Where one of them has a pole or zero below all lines, the record does not give the gain at rest.
    """
    others = tuple(others)
    figures = np.array([fit.resonance, fit.damping, fit.gain_ratio])
    away = [_figures(each, fit) - figures for each in others]
    reach = np.array([np.zeros(3), *away])
    below, above = reach.min(axis=0), reach.max(axis=0)
    intervals = fit.resonance_interval, fit.damping_interval, fit.gain_interval
    resonance, damping, gain = (
        (low + float(below[k]), high + float(above[k])) for k, (low, high) in enumerate(intervals)
    )
    if not all(each.identifies_gain for each in (fit, *others)):
        gain = (-np.inf, np.inf)
    return evolve(fit, resonance_interval=resonance, damping_interval=damping, gain_interval=gain)


def _figures(other: RationalFit, fit: RationalFit) -> Array:
    """Frequency (Hz) and damping ratio of the nearest pole, as another may peak higher; gain."""
    poles = np.roots(other.model.denominator)
    omega = np.abs(poles)
    nearest = int(np.argmin(np.abs(np.log(omega / (2.0 * np.pi * fit.resonance)))))
    damping = -poles[nearest].real / omega[nearest]
    return np.array([omega[nearest] / (2.0 * np.pi), damping, other.gain_ratio])


UNITS = {"gain": "1", "time_constant": "s"}
"""Of the parameters of creep, by how their names begin."""


def drive_range(drive: Array) -> Range:
    """Least and greatest drive, V, of a record (n,)."""
    return float(drive.min()), float(drive.max())


def creep_status(fit: CreepFit, record: AxisRecord) -> EffectStatus:
    """Status of a creep fitted to a record of steps."""
    longest = len(record.drive) * record.sample_period
    return EffectStatus(
        drive=drive_range(record.drive),
        hold_times=(record.sample_period, longest),
        intervals=tuple(
            closed(name, interval, UNITS[name.rsplit("_", 1)[0]])
            for name, interval in fit.intervals.items()
        ),
    )


def vibration_status(
    fit: RationalFit, record: AxisRecord, gauge: float | None = 1.0
) -> EffectStatus:
    """Status of a vibration fitted to a frequency response, its gain over a ``gauge``.

    The gain is that at rest, which creep and larger loops raise: a fast record alone gives none,
    and there is no gauge.
    """
    gain = tuple(end / gauge for end in fit.gain_interval) if gauge else (-np.inf, np.inf)
    return EffectStatus(
        drive=drive_range(record.drive),
        frequencies=fit.band,
        intervals=(
            closed("resonance", fit.resonance_interval, "Hz"),
            closed("damping", fit.damping_interval, "1"),
            closed("gain", (gain[0], gain[1]), "1"),
        ),
    )


def hysteresis_status(record: AxisRecord) -> EffectStatus:
    """Status of a hysteresis fitted to a record, which holds up to its fastest turns."""
    return EffectStatus(
        drive=drive_range(record.drive),
        frequencies=(0.0, swings(record.drive) / record.sample_period),
    )
