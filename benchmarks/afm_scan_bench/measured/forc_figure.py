"""Picture of held-out measured reversal curves, of the surface's density and the residual."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.identification.hysteresis.everett_least_squares import FittedSurface
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurve
from afm_scan_ros.report.style import BLUE, GREY, ORANGE, styled

KILO, MILLI, MICRO = 1e3, 1e-3, 1e-6


@styled
def forc_figure(fitted: FittedSurface, held_out: Sequence[ReversalCurve]) -> Figure:
    """Held-out curves, measured and predicted; density; error over the field."""
    figure = Figure(figsize=(9.6, 3.4), dpi=120, layout="constrained")
    figure.suptitle(
        "First-order reversal curves (hchb_forc), data © 2024 Peyton Murray, MIT licence",
        x=0.01,
        ha="left",
    )
    loops, density, errors = figure.subplots(1, 3)
    _curves(loops, fitted, held_out[1::3])
    _density(density, fitted)
    _errors(errors, fitted, held_out)
    return figure


def _curves(axes: Axes, fitted: FittedSurface, held_out: Sequence[ReversalCurve]) -> None:
    for curve in held_out:
        field = curve.inputs / KILO
        axes.plot(field, curve.outputs / MILLI, color=GREY, lw=3.0)
        axes.plot(field, fitted.predict(curve) / MILLI, color=BLUE, lw=0.8)
    axes.set(title="Left out (grey), predicted (blue)", xlabel="field in kOe")
    axes.set_ylabel("moment in memu")


def _density(axes: Axes, fitted: FittedSurface) -> None:
    """Mixed second difference of the surface over its cells (Eq. 15)."""
    step = fitted.grid.levels[1] - fitted.grid.lower
    density = -np.diff(np.diff(fitted.values, axis=0), axis=1) / step**2
    density[~np.tri(len(density), dtype=np.bool_)] = np.nan
    span = fitted.grid.lower / KILO, fitted.grid.upper / KILO
    density *= KILO**2 / MILLI
    largest = np.nanmax(np.abs(density))
    image = axes.imshow(
        density,
        origin="lower",
        extent=(*span, *span),
        cmap="RdBu_r",
        vmin=-largest / 3.0,
        vmax=largest / 3.0,
    )
    bar = axes.figure.colorbar(image, ax=axes, extend="both", shrink=0.8)
    bar.set_label("memu per kOe²")
    axes.set(title="Preisach density", xlabel="beta in kOe", ylabel="alpha in kOe")


def _errors(axes: Axes, fitted: FittedSurface, held_out: Sequence[ReversalCurve]) -> None:
    for curve in held_out:
        error = (fitted.predict(curve) - curve.outputs) / MICRO
        axes.plot(curve.inputs / KILO, error, ".", ms=1.5, color=ORANGE)
    axes.set(title="Predicted less measured", xlabel="field in kOe", ylabel="moment in µemu")
