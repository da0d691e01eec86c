"""Everett surfaces of measured first-order reversal curves; curves left out are predicted.

The curves are magnetic (github peytondmurray/pyforc, MIT, (c) 2024 Peyton Murray); the mathematics
is that of a piezo's. All turn on the falling branch, from 1141 Oe down: above, there are no
data, and nothing is fitted or predicted.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from afm_scan_bench.measured.curve_noise import curve_noise
from afm_scan_bench.measured.drift_points import freed_of_drift
from afm_scan_bench.measured.micromag import MicroMagRecord, read_micromag
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import (
    FittedSurface,
    fit_surface,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurve
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORD = "forc/hchb_forc"
LEVELS = (51, 101, 151)
LEFT_OUT = 5
"""Every so many-th curve is held out; the first and the last stay."""

COLUMNS = {
    "drift": ("drift", ""),
    "levels": ("levels", "d"),
    "strength": ("penalty", "g"),
    "rms_nemu": ("rms, nemu", ".0f"),
    "max_nemu": ("max, nemu", ".0f"),
    "rms_percent": ("rms, % of range", ".4f"),
    "over_noise": ("rms / noise", ".2f"),
    "free_rms_nemu": ("free: rms, nemu", ".0f"),
}


def measure() -> Table:
    """Predict every fifth of 152 curves from the others, the drift left in and taken off."""
    record = read_micromag(measured_data(RECORD))
    kinds = {"left in": record.curves, "off": freed_curves(record)}
    rows: list[Row] = [
        {"drift": kind, "levels": levels, **held_out_figures(curves, levels)}
        for kind, curves in kinds.items()
        for levels in LEVELS
    ]
    title = "Measured reversal curves (hchb_forc): every fifth left out and predicted"
    return Table("forc", title, COLUMNS, rows, picture=lambda: picture(kinds["off"]))


def picture(curves: Sequence[ReversalCurve]) -> "Figure":
    """Draw the curves left out and what the finest surface makes of them."""
    from afm_scan_bench.measured.forc_figure import forc_figure  # noqa: PLC0415 - slow to import

    kept, held_out = divided(curves)
    fitted = fit_rising(kept, LEVELS[-1]).monotone()
    return forc_figure(
        fitted, [curve.within(fitted.grid.lower, fitted.grid.upper) for curve in held_out]
    )


def freed_curves(record: MicroMagRecord) -> Sequence[ReversalCurve]:
    """Curves freed of the drift that the moments at saturation show."""
    return freed_of_drift(record.curves, record.drift[:, 1])


def divided(
    curves: Sequence[ReversalCurve],
) -> tuple[Sequence[ReversalCurve], Sequence[ReversalCurve]]:
    """Curves to fit and held-out curves."""
    held_out = range(LEFT_OUT // 2, len(curves), LEFT_OUT)
    return [c for k, c in enumerate(curves) if k not in held_out], [curves[k] for k in held_out]


def held_out_figures(curves: Sequence[ReversalCurve], levels: int) -> Row:
    """Errors of the monotone surface on curves left out, beside one that is fitted freely.

    In nemu, in % of the outputs' range, and over the noise.
    """
    kept, held_out = divided(curves)
    free = fit_rising(kept, levels)
    error, unbound = (
        np.concatenate([deviation(fitted, curve) for curve in held_out])
        for fitted in (free.monotone(), free)
    )
    whole = np.ptp(np.concatenate([curve.outputs for curve in curves]))
    rms, largest = np.sqrt(np.mean(error**2)), np.abs(error).max()
    return {
        "strength": free.strength,
        "points": len(error),
        "rms_nemu": 1e9 * float(rms),
        "max_nemu": 1e9 * float(largest),
        "rms_percent": 100.0 * float(rms / whole),
        "max_percent": 100.0 * float(largest / whole),
        "over_noise": float(rms) / curve_noise(curves),
        "free_rms_nemu": 1e9 * float(np.sqrt(np.mean(unbound**2))),
    }


def fit_rising(curves: Sequence[ReversalCurve], levels: int) -> FittedSurface:
    """Fit a surface to rising curves where they have data: from their turns to where all reach."""
    turns = [curve.turn for curve in curves]
    grid = EverettGrid(min(turns), min(curve.inputs[-1] for curve in curves), levels)
    alpha, beta = np.meshgrid(grid.levels, grid.levels, indexing="ij")
    inner = [curve.within(grid.lower, grid.upper) for curve in curves]
    return fit_surface(inner, grid, where=(beta <= max(turns)) & (alpha > beta))


def deviation(fitted: FittedSurface, curve: ReversalCurve) -> Array:
    """Prediction less measurement at the points of a curve that the surface knows, shape (n,)."""
    inner = curve.within(fitted.grid.lower, fitted.grid.upper)
    error = fitted.predict(inner) - inner.outputs
    return error[np.isfinite(error)]
