"""Whether times that were written down are those of an even clock, and what its period is."""

from collections.abc import Iterable

import numpy as np
from attrs import frozen
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import minimize_scalar

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

GAP = 0.5
"""Of the usual step: one that differs by more is of samples lost or written twice."""
FEW = 0.25
"""Share of such steps up to which they are gaps, beyond which the sampling is irregular."""
NEAR = 10
"""Times before and after a step that show whether they stay late: jitter does not."""
COARSE = 1e-3
"""Relative error of the period that rounded times may leave: a resonance's is as large."""
BURIED = 0.1
"""What jitter may add to the variance of a displacement's noise."""
FEWEST_DIGITS, DIGITS = 4, 15
"""Decimal or significant digits with which times are written."""
ORDER, ROWS = 12, 20_000
"""Samples that predict the next one, and rows that fit the predictor, at most."""


@frozen
class Timing:
    """The period (s) of an even clock, and a sentence on how far the times stray from it."""

    sample_period: float
    note: str = ""


def timing_of(time: Array, moved: Iterable[Array] = (), first_row: int = 1) -> Timing:
    """Find the period of times (s), (n,), at which displacements ``moved`` (m), (n,), were read.

    The times may be rounded: then an even clock lies within half of their last digit. They may
    jitter where that moves each displacement by less than its noise, both measured here. Raises
    InputError, which names the row (``first_row`` is that of the first time), for all other times.
    """
    if time[-1] <= time[0]:
        raise InputError(f"time falls from {time[0]:g} to {time[-1]:g} s: sort the rows by time")
    period, spread = _even_clock(time)
    exact = 8.0 * np.finfo(float).eps * float(np.abs(time).max())
    if spread <= exact:
        return Timing(period)
    digit = _last_digit(time)
    if spread <= (1.0 + 1e-5) * digit + exact and digit <= GAP * period:
        _refuse_coarse(digit, time)
        return Timing(period)
    if (period_of_few := _of_few_digits(time, period)) is not None:
        return Timing(period_of_few)
    _refuse_gaps(time, first_row)
    return _jittering(time, period, moved)


def _even_clock(time: Array) -> tuple[float, float]:
    """Return the period whose even times come nearest in the worst case, and how far they stray.

    That is twice the largest distance: the spread of the times' residual.
    """
    numbers = np.arange(len(time), dtype=np.float64)
    usual = float((time[-1] - time[0]) / numbers[-1])
    reach = 2.0 * float(np.ptp(time - time[0] - usual * numbers)) / numbers[-1]

    def spread(change: float) -> float:
        return float(np.ptp(time - time[0] - (usual + reach * change) * numbers))

    if reach == 0.0:
        return usual, 0.0
    best = minimize_scalar(spread, bounds=(-1.0, 1.0), method="bounded", options={"xatol": 1e-6})
    return min((spread(change), usual + reach * change) for change in (0.0, float(best.x)))[::-1]


def _last_digit(time: Array) -> float:
    """Return the decimal place to which all times are rounded, s; 0 where they are not."""
    for digits in range(DIGITS):
        scaled = time * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) <= 8.0 * np.spacing(np.abs(scaled))):
            return float(10.0**-digits)
    return 0.0


def _of_few_digits(time: Array, near: float) -> float | None:
    """Return the period of times with so many significant digits, as ``%.7g`` writes them.

    Later ones are rounded to more: each lies within its own last digit of an even clock that begins
    with the first. None where there is no such clock ``near`` a period, or it is uncertain.
    """
    size = np.abs(time)
    magnitude = np.floor(np.log10(np.maximum(size, size[size > 0.0].min())))
    numbers = np.arange(len(time), dtype=np.float64)
    for digits in range(FEWEST_DIGITS, DIGITS):
        last = 10.0 ** (magnitude + 1.0 - digits)
        scaled = time / last
        if np.any(np.abs(scaled - np.round(scaled)) > 8.0 * np.spacing(np.abs(scaled))):
            continue
        reach = float(last[-1] / numbers[-1])

        def stray(change: float, last: Array = last, reach: float = reach) -> float:
            apart = time - time[0] - (near + reach * change) * numbers
            return float(np.max(np.abs(apart[1:]) / last[1:]))

        best = minimize_scalar(stray, bounds=(-1.0, 1.0), method="bounded")
        precise = reach * numbers[-1] <= COARSE * float(time[-1] - time[0])
        return near + reach * float(best.x) if best.fun <= 1.0 and precise else None
    return None


def _refuse_coarse(digit: float, time: Array) -> None:
    error = digit / float(time[-1] - time[0])
    if error > COARSE:
        raise InputError(
            f"time is rounded to {digit:g} s, which leaves the sample period uncertain by"
            f" {error:.1%}: give the sample rate instead of the column time"
        )


def _refuse_gaps(time: Array, first_row: int) -> None:
    """Raise InputError for the first uneven step after which times stay late, or early."""
    steps = np.diff(time)
    usual = float(np.median(steps)) or float(np.mean(steps))
    uneven = np.flatnonzero(np.abs(steps - usual) > GAP * abs(usual))
    if uneven.size > FEW * len(steps):
        _refuse_irregular(time)
    late = time - usual * np.arange(len(time))
    for place in uneven:
        before, after = late[max(0, place + 1 - NEAR) : place + 1], late[place + 1 :][:NEAR]
        if abs(np.median(after) - np.median(before)) > GAP * abs(usual):
            row = int(place) + first_row
            raise InputError(
                f"time runs {steps[place]:g} s from row {row} to row {row + 1}, elsewhere"
                f" {usual:g} s: import the rows before and after separately, with --start-row and"
                " --stop-row"
            )


def _refuse_irregular(time: Array, why: str = "") -> None:
    steps = np.diff(time)
    raise InputError(
        f"time is irregular: its steps are {steps.min():g} to {steps.max():g} s, usually"
        f" {np.median(steps):g} s{why}: sample by an even clock. Where the clock is even and only"
        " the times are not, give the sample rate instead of the column time"
    )


def _jittering(time: Array, period: float, moved: Iterable[Array]) -> Timing:
    """Take times for even ones where no displacement shows the difference."""
    even = np.mean(time - period * np.arange(len(time))) + period * np.arange(len(time))
    stated = []
    for values in moved:
        if not np.ptp(values):
            continue
        on_time = np.interp(even, time, values)
        shift, noise = float(np.sqrt(np.mean((on_time - values) ** 2))), _noise(on_time)
        stated.append(
            f"which moves a displacement by {1e9 * shift:.3g} nm where {1e9 * noise:.3g} nm are"
            " noise"
        )
        if shift**2 > BURIED * noise**2:
            _refuse_irregular(time, f", {stated[-1]}")
    if not stated:
        _refuse_irregular(time)
    jitter = float(np.std(time - even))
    return Timing(
        period, f"time jitters by {jitter:.2g} s rms, {stated[0]}: taken as every {period:.7g} s"
    )


def _noise(values: Array) -> float:
    """Rms error of the linear prediction of a displacement from the samples before, m."""
    if len(values) <= 2 * ORDER:
        return 0.0
    windows = sliding_window_view(values - values.mean(), ORDER + 1)
    rows = windows[np.linspace(0, len(windows) - 1, min(ROWS, len(windows))).astype(int)]
    weights = np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=None)[0]
    residual = rows[:, -1] - rows[:, :-1] @ weights
    return float(np.sqrt(np.mean(residual**2) / (1.0 + np.sum(weights**2))))
