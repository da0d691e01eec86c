"""Pictures of an identification, x above y: what was measured, the model, and what is left."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, ORANGE, styled

NANO, MILLI = 1e9, 1e3
POINTS = 4000
"""Stretches of a drawn signal: as many as show."""

Draw = Callable[[Axes, AxisIdentification], None]


@styled
def creep_figure(found: Identification) -> Figure:
    """Draw what each order leaves of the creep's held-out part, and that residual over time."""
    return _panels(found, {"held out, by order": _orders, "residual, held out": _creep_residual})


@styled
def hysteresis_figure(found: Identification) -> Figure:
    """Draw the loops that F = H(u) was read from, and the residual on loops that fitted nothing."""
    return _panels(found, {"freed of creep and vibration": _loops, "fresh loops": _fresh})


@styled
def model_discrepancy_figure(found: Identification) -> Figure:
    """Draw the residual of prediction over time, and its rms by band."""
    return _panels(found, {"residual": _validation, "rms by band": _bands})


def _panels(found: Identification, panels: dict[str, Draw]) -> Figure:
    figure = Figure(figsize=(9.6, 2.6 * len(found.axes)), layout="constrained")
    grid = figure.subplots(len(found.axes), len(panels), squeeze=False)
    for row, (name, axis) in zip(grid, found.axes.items(), strict=True):
        for panel, (title, draw) in zip(row, panels.items(), strict=True):
            draw(panel, axis)
            panel.set_title(f"{name}: {title}")
    return figure


def _orders(panel: Axes, found: AxisIdentification) -> None:
    creep = found.report.creep
    sigma = [NANO * tried.held_out.sigma for tried in creep.orders]
    panel.semilogy([tried.order for tried in creep.orders], sigma, "o-", color=BLUE)
    panel.axhline(NANO * creep.noise, color=GREY, label="noise of the record")
    panel.axvline(creep.order, color=ORANGE, ls=":", label="chosen")
    panel.set(xlabel="elements", ylabel="sigma (Eq. 2) in nm")
    panel.legend()


def _creep_residual(panel: Axes, found: AxisIdentification) -> None:
    creep = found.report.creep
    error = next(tried.error for tried in creep.orders if tried.order == creep.order)
    _dense(panel, np.arange(len(error), dtype=np.float64), NANO * error, BLUE)
    panel.set(xlabel="number of the sample held out", ylabel="error in nm")


def _loops(panel: Axes, found: AxisIdentification) -> None:
    every = max(1, len(found.drive) // (10 * POINTS))
    panel.plot(found.drive[::every], found.effective[::every], color=BLUE, lw=0.4)
    panel.set(xlabel="drive u in V", ylabel="effective input F in V")


def _fresh(panel: Axes, found: AxisIdentification) -> None:
    samples = np.arange(len(found.fresh.exact), dtype=np.float64)
    _dense(panel, samples, MILLI * found.fresh.direct, ORANGE, "direct inverse")
    _dense(panel, samples, MILLI * found.fresh.exact, BLUE, "exact inverse")
    panel.set(xlabel="number of the sample held out", ylabel="error of u in mV")
    panel.legend()


def _validation(panel: Axes, found: AxisIdentification) -> None:
    left = found.validation
    seconds = left.sample_period * np.arange(len(left.residual), dtype=np.float64)
    _dense(panel, seconds, NANO * left.residual, BLUE)
    panel.set(xlabel="time in s", ylabel="measured - predicted in nm")


def _bands(panel: Axes, found: AxisIdentification) -> None:
    known = found.validation.model_discrepancy
    lines = {
        "displacement": (known.displacement, LIGHT_BLUE),
        "error": (known.rms, BLUE),
        "noise": (known.noise, GREY),
    }
    edges = np.maximum(known.bands, known.bands[1] / 10.0)
    for label, (rms, colour) in lines.items():
        panel.stairs(NANO * np.array(rms), edges, color=colour, label=label)
    panel.set(xlabel="frequency in Hz", ylabel="rms in nm", xscale="log", yscale="log")
    panel.legend()


def _dense(panel: Axes, x: Array, y: Array, colour: str, label: str | None = None) -> None:
    """Draw a long signal by the lowest and the highest sample of each stretch of it."""
    every = max(1, len(y) // POINTS)
    whole = len(y) // every * every
    stretches = y[:whole].reshape(-1, every)
    ends = np.column_stack([stretches.min(axis=1), stretches.max(axis=1)]).ravel()
    panel.plot(np.repeat(x[:whole:every], 2), ends, color=colour, lw=0.6, label=label)
