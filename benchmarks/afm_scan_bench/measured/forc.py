"""Measured first-order reversal curves: those left out are predicted from the others.

The curves are magnetic (github peytondmurray/pyforc, MIT, (c) 2024 Peyton Murray); the mathematics
is that of a piezo's. All turn on the falling branch, from 1141 Oe down, and all have closed at the
largest field that every curve reaches. Field (kOe) and moment stand for drive and displacement.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_bench.measured.curve_noise import curve_noise
from afm_scan_bench.measured.drift_points import freed_of_drift
from afm_scan_bench.measured.micromag import MicroMagRecord, read_micromag
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_bench.measured.reversal_curve import ReversalCurve, joined
from afm_scan_ros.report.table import Row, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORD = "forc/hchb_forc"
PERIOD = 72361.08 / 30628
"""Seconds between points, the mean over the file."""
LEFT_OUT = 5
"""Every so many-th curve is held out; the first and the last stay."""

COLUMNS = {
    "drift": ("drift", ""),
    "points": ("points", "d"),
    "rms_nemu": ("rms, nemu", ".0f"),
    "max_nemu": ("max, nemu", ".0f"),
    "rms_percent": ("rms, % of range", ".4f"),
    "over_noise": ("rms / noise", ".2f"),
}


def measure() -> Table:
    """Predict every fifth of 152 curves from the others, the drift left in and taken off."""
    record = read_micromag(measured_data(RECORD))
    kinds = {"left in": record.curves, "off": freed_curves(record)}
    parts = {kind: divided(curves) for kind, curves in kinds.items()}
    found = {kind: predicted(*part) for kind, part in parts.items()}
    rows: list[Row] = [
        {"drift": kind, **held_out_figures(kinds[kind], parts[kind][1], found[kind])}
        for kind in kinds
    ]
    title = "Measured reversal curves (hchb_forc): every fifth left out and predicted"
    return Table(
        "forc", title, COLUMNS, rows, picture=lambda: picture(parts["off"][1], found["off"])
    )


def picture(held_out: Sequence[ReversalCurve], found: Sequence[ReversalCurve]) -> "Figure":
    """Draw the curves left out and what is predicted of them."""
    from afm_scan_bench.measured.forc_figure import forc_figure  # noqa: PLC0415 - slow to import

    return forc_figure(held_out, found)


def freed_curves(record: MicroMagRecord) -> Sequence[ReversalCurve]:
    """Curves freed of the drift that the moments at saturation show."""
    return freed_of_drift(record.curves, record.drift[:, 1])


def divided(
    curves: Sequence[ReversalCurve],
) -> tuple[Sequence[ReversalCurve], Sequence[ReversalCurve]]:
    """Curves to fit and held-out curves, both to the field that every curve reaches."""
    top = min(float(curve.inputs[-1]) for curve in curves)
    cut = [curve.up_to(top) for curve in curves]
    held_out = range(LEFT_OUT // 2, len(curves), LEFT_OUT)
    return [c for k, c in enumerate(cut) if k not in held_out], [cut[k] for k in held_out]


def predicted(
    kept: Sequence[ReversalCurve], held_out: Sequence[ReversalCurve]
) -> list[ReversalCurve]:
    """Return held-out curves as a model of those kept predicts them, its zero that of the kept."""
    fitted, asked = joined(kept, PERIOD), joined(held_out, PERIOD)
    model = afm.identify([fitted])
    zero = float(np.mean((fitted.displacement - model.predict(fitted.drive, PERIOD))[1:]))
    moved = zero + model.predict(asked.drive, PERIOD)[2:, 0]
    cuts = np.cumsum([len(curve.inputs) for curve in held_out])[:-1]
    return [
        evolve(curve, outputs=outputs)
        for curve, outputs in zip(held_out, np.split(moved, cuts), strict=True)
    ]


def held_out_figures(
    curves: Sequence[ReversalCurve],
    held_out: Sequence[ReversalCurve],
    found: Sequence[ReversalCurve],
) -> Row:
    """Errors of held-out curves: in nemu, in % of the range of all, and over their noise."""
    error = np.concatenate(
        [one.outputs - other.outputs for one, other in zip(found, held_out, strict=True)]
    )
    whole = np.ptp(np.concatenate([curve.outputs for curve in curves]))
    rms, largest = np.sqrt(np.mean(error**2)), np.abs(error).max()
    return {
        "points": len(error),
        "rms_nemu": 1e9 * float(rms),
        "max_nemu": 1e9 * float(largest),
        "rms_percent": 100.0 * float(rms / whole),
        "max_percent": 100.0 * float(largest / whole),
        "over_noise": float(rms) / curve_noise(curves),
    }
