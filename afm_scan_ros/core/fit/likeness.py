"""Whether records are of one scanner: the gain that each shows, and the way round of its loops.

Of two records, or where the gain is 1 in the units of the columns, loops show which has its columns
exchanged: they go the other way, as displacement lags the drive in every scanner.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from attrs import frozen
from scipy.stats import t as student

from afm_scan_ros.core.bands import weighted
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.signals import Signals
from afm_scan_ros.core.types import Array

UNITS = 10.0 ** np.array([0, -3, -6, -9])
"""Of length that a column is given in, m."""
DIGITS = 6
"""Of the logarithm of a gain: two records differ equally from their median; loops then decide."""


@frozen
class _RecordGain:
    """Gain of a record over the model's, and how wide its loops open, 1/m of its motion.

    Loops open by more the farther the drive goes (Rayleigh); those that lag are positive. ``half``
    is the half-width of their 95 % interval, infinite where the drive mostly rests. ``swing`` (V)
    is how far the drive goes.
    """

    name: str
    gain: float
    swing: float
    loops: float
    half: float


def refuse_unlike(fit: AxisFit) -> None:
    """Refuse a record that is not of the scanner of the others, or has its columns exchanged.

    Records are compared by their motion below the first mode, and one that hardly moves there is
    not. Raises InputError, which names the record.
    """
    simulations = fit.simulated(fit.theta)
    lines = [fit.gain * one.output for one in simulations]
    mode = min((omega for omega, *_ in fit.layout.of_modes(fit.theta)), default=np.inf)
    highest, settings = mode / (2.0 * np.pi), fit.layout.settings
    pairs = zip(fit.records, lines, strict=True)
    found = [_shown(record, line[record.used], highest, settings) for record, line in pairs]
    shown = [one for one in found if one is not None]
    if len(shown) > 1:
        _refuse_gains(shown, fit.gain, settings)
        _refuse_backward(shown, fit.gain, settings.like_gains)


def _shown(record: Signals, line: Array, mode: float, settings: FitSettings) -> _RecordGain | None:
    """Fit a curved line, parabolas that close where the drive turns (Rayleigh), and a delay.

    Returns None where the record hardly moves below the ``mode`` (Hz).
    """
    count = len(line)
    frequency = np.arange(count) / (2.0 * count * record.length)
    slow = np.where(frequency < settings.slow_share * mode, 1.0, 0.0)
    moved, along = (weighted(each - each.mean(), slow) for each in (record.mean, line))
    if np.std(along) <= settings.least_slow * np.std(line):
        return None
    span = float(np.ptp(along))
    across, speed = 2.0 * (along - along.min()) / span - 1.0, np.gradient(along)
    opening = -(span**2) * np.sign(speed) * (1.0 - across**2)
    columns = np.column_stack([along, span * across**2, opening, speed])
    columns -= columns.mean(axis=0)
    found = np.linalg.lstsq(columns, moved, rcond=None)[0]
    gain = float(along @ moved / (along @ along))
    rests = np.median(np.abs(np.diff(record.drive))) == 0.0
    edges = np.linspace(0, count, settings.likeness_parts + 1).astype(int)
    parts = [slice(*ends) for ends in pairwise(edges)]
    half = np.inf if rests else jackknife(parts, columns, moved - columns @ found)[2] / abs(gain)
    swing = float(np.ptp(record.drive))
    return _RecordGain(record.name, gain, swing, float(found[2] / gain), float(half))


def jackknife(groups: Sequence[slice], jacobian: Array, residual: Array) -> Array:
    """Half-widths of 95 % intervals, (p,), by a residual (n,) and its jacobian (n, p).

    The jackknife that leaves out a group at a time, linearised: unlike the sandwich it is not too
    narrow where groups are few or unlike.
    Source: J. G. MacKinnon, M. Ø. Nielsen and M. D. Webb, J. Econometrics 232 (2023) 272, Eq. 13.
    """
    whole, count = jacobian.T @ jacobian, len(groups)
    moved = []
    for rows in groups:
        along = jacobian[rows]
        moved.append(np.linalg.pinv(whole - along.T @ along) @ (along.T @ residual[rows]))
    spread = np.sum((np.array(moved) - np.mean(moved, axis=0)) ** 2, axis=0)
    return np.asarray(student.ppf(0.975, count - 1) * np.sqrt(spread * (count - 1) / count))


def _refuse_gains(shown: Sequence[_RecordGain], scale: float, settings: FitSettings) -> None:
    """Refuse the record whose gain differs most, where that is by more than a scanner's does.

    The gain of one scanner may grow with the swing of its drive, by ``swing_gains``.
    """
    usual = float(np.exp(np.median(np.log([abs(one.gain) for one in shown]))))
    backward = sorted(shown, key=lambda one: one.loops)
    worst = max(backward, key=lambda one: round(abs(np.log(abs(one.gain) / usual)), DIGITS))
    others = [one for one in shown if one is not worst]
    beside, most = float(np.median([one.gain for one in others])), settings.like_gains
    farther = worst.swing > float(np.median([one.swing for one in others]))
    grown = settings.swing_gains ** (1.0 if farther else -1.0)
    if min(grown, 1.0) / most <= worst.gain / beside <= max(grown, 1.0) * most:
        return
    why = (
        "its drive and displacement columns are exchanged; name them the other way round"
        if _may_be_exchanged(worst.gain, beside, scale, settings.like_gains)
        else "it is of another axis, scanner, unit or amplifier; leave it out, or give its units"
    )
    reference = others[0].name if len(others) == 1 else "the other records"
    raise InputError(
        f"{worst.name}: it moves {1e9 * scale * worst.gain:.4g} nm per volt, but {reference}"
        f" {1e9 * scale * beside:.4g} nm: {why}"
    )


def _may_be_exchanged(gain: float, beside: float, scale: float, most: float) -> bool:
    """Whether a gain is the inverse of those beside it, in the unit of some column."""
    ratio = gain * beside * (scale / UNITS) ** 2
    return bool(np.any((ratio > 1.0 / most) & (ratio < most)))


def _refuse_backward(shown: Sequence[_RecordGain], scale: float, most: float) -> None:
    """Refuse a record whose loops go the other way about as wide, with 95 % confidence.

    Its gain is the inverse of the others', or else its columns are not exchanged.
    """
    looping = [one for one in shown if np.isfinite(one.half)]
    for one in looping:
        others = [each for each in looping if each is not one]
        least = min((each.loops - each.half for each in others), default=0.0)
        beside = float(np.median([each.gain for each in others])) if others else 0.0
        inverse = _may_be_exchanged(one.gain, beside, scale, most)
        if inverse and least > 0.0 and one.loops + one.half < -least / most:
            raise InputError(
                f"{one.name}: its displacement runs ahead of its drive, as wide as those of the"
                " other records lag: its two columns are exchanged; name them the other way round"
            )
