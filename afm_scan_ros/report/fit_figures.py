"""Pictures of an identification: Bode plots, fits, residuals and discrepancy."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import Complex, RationalFit
from afm_scan_ros.core.identification.vibration.response_checks import COHERENCE
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.style import (
    BLUE,
    DARK_GREY,
    GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    MILLI,
    NANO,
    ORANGE,
    blank,
    dense,
    legend_above,
    styled,
)

ZOOM = 6.0
"""Half-widths of the resonance that the close-up shows on either side."""


@styled
def bode_figure(
    measured: FrequencyResponse,
    fit: RationalFit,
    sample_period: float,
    at_rest: FrequencyResponse | None = None,
) -> Figure:
    """Draw magnitude, phase and coherence over all lines, and the resonance close up.

    Lines without a marker are the standard deviations that noise and nonlinearity give the
    response. ``at_rest`` is the response extrapolated to zero amplitude, drawn beside it.
    """
    figure = blank(9.6, 6.4, _caption(fit))
    left, right = _bode_panels(figure, beyond=(fit.band[1], float(measured.frequency[-1])))
    model = _model(measured.omega, fit, sample_period)
    _magnitude(left[0], measured, model, at_rest)
    _deviations(left[0], measured)
    _phase(left[1], measured, model)
    _coherence(left[2], measured)
    legend_above(left[0], columns=3)
    legend_above(left[2], columns=3)
    _close_up(right[0], measured, fit, sample_period)
    _residual(right[1], measured, model, fit)
    return figure


def _bode_panels(figure: Figure, beyond: tuple[float, float]) -> tuple[list[Axes], list[Axes]]:
    """Three panels over all lines, grey ``beyond`` (Hz) the band fitted, and two close up."""
    sides = figure.add_gridspec(1, 2, width_ratios=(1.8, 1.0))
    over_all = sides[0].subgridspec(3, 1, height_ratios=(2.0, 1.3, 0.8))
    close_up = sides[1].subgridspec(2, 1, height_ratios=(3.0, 1.0))
    left = [figure.add_subplot(over_all[row]) for row in range(3)]
    for panel in left:
        panel.set_xscale("log")
        panel.sharex(left[0])
        if beyond[0] < beyond[1]:
            panel.axvspan(*beyond, color=GREY, alpha=0.3, lw=0.0, label="not fitted")
        panel.tick_params(labelbottom=panel is left[-1])
    return left, [figure.add_subplot(close_up[row]) for row in range(2)]


def _caption(fit: RationalFit) -> str:
    frequency, damping = fit.resonance_interval, fit.damping_interval
    return (
        f"{fit.order}: resonance {fit.resonance:.3f} Hz (95 % from {frequency[0]:.3f} to"
        f" {frequency[1]:.3f}), damping {fit.damping:.5f} ({damping[0]:.5f} to {damping[1]:.5f})"
    )


def _model(omega: Array, fit: RationalFit, sample_period: float) -> Complex:
    """Response of the model at the lines, after the hold and with the record's own gain."""
    return fit.gain_ratio * held(fit.model, sample_period).response(omega)


def _magnitude(
    panel: Axes, measured: FrequencyResponse, model: Complex, at_rest: FrequencyResponse | None
) -> None:
    frequency = measured.frequency
    size = MICRO * np.abs(measured.response)
    panel.loglog(frequency, size, ".", ms=2.5, color=LIGHT_BLUE, label="measured")
    panel.loglog(frequency, MICRO * np.abs(model), color=BLUE, label="model")
    if at_rest is not None:
        size = MICRO * np.abs(at_rest.response)
        panel.loglog(
            at_rest.frequency, size, "--", color=ORANGE, label="response to u, zero amplitude"
        )
    panel.set_ylabel("response to F in µm/V")


def _deviations(panel: Axes, measured: FrequencyResponse) -> None:
    for values, colour, name in (
        (measured.nonlinearity, LIGHT_ORANGE, "nonlinearity (sd)"),
        (measured.noise, DARK_GREY, "noise (sd)"),
    ):
        shown = np.where(values > 0.0, MICRO * values, np.nan)
        panel.loglog(measured.frequency, shown, color=colour, lw=0.8, label=name)


def _phase(panel: Axes, measured: FrequencyResponse, model: Complex) -> None:
    """Show the phases with the 95 % band of the measured one's scatter."""
    phase, smooth = (np.degrees(np.unwrap(np.angle(r))) for r in (measured.response, model))
    half = np.degrees(1.96 * measured.deviation / np.abs(measured.response))
    panel.fill_between(
        measured.frequency, phase - half, phase + half, color=LIGHT_BLUE, alpha=0.4, lw=0.0
    )
    panel.plot(measured.frequency, phase, ".", ms=2.5, color=LIGHT_BLUE)
    panel.plot(measured.frequency, smooth, color=BLUE)
    panel.set_ylabel("phase in degrees")
    low, high = min(smooth.min(), phase.min()), max(smooth.max(), phase.max())
    panel.set_yticks(np.arange(90.0 * np.floor(low / 90.0), high + 90.0, 90.0))


def _coherence(panel: Axes, measured: FrequencyResponse) -> None:
    panel.plot(measured.frequency, measured.coherence, color=BLUE, lw=0.8, label="coherence")
    panel.axhline(COHERENCE, color=DARK_GREY, lw=0.8, ls="--", label="lowest coherence")
    panel.set(xlabel="frequency in Hz", ylabel="coherence", ylim=(None, 1.0 + 1e-3))


def _close_up(
    panel: Axes, measured: FrequencyResponse, fit: RationalFit, sample_period: float
) -> None:
    half = ZOOM * fit.damping * fit.resonance
    low, high = fit.resonance - half, fit.resonance + half
    near = measured.at((measured.frequency >= low) & (measured.frequency <= high))
    size, bar = MICRO * np.abs(near.response), MICRO * 1.96 * near.deviation
    panel.errorbar(near.frequency, size, bar, fmt=".", ms=4, color=LIGHT_BLUE, label="measured")
    fine = np.linspace(low, high, 400)
    curve = MICRO * np.abs(_model(2.0 * np.pi * fine, fit, sample_period))
    panel.plot(fine, curve, color=BLUE, label="model")
    panel.axvspan(*fit.resonance_interval, color=ORANGE, alpha=0.6, lw=0.5, label="95 % interval")
    panel.set(xlabel="frequency in Hz", ylabel="response to F in µm/V")
    legend_above(panel, columns=3)


def _residual(panel: Axes, measured: FrequencyResponse, model: Complex, fit: RationalFit) -> None:
    """Show the residual of the fitted lines, beside the one that scatter explains."""
    used = measured.frequency <= fit.band[1]
    size = np.abs(measured.response[used])
    residual = np.abs(model - measured.response)[used] / size
    frequency = measured.frequency[used]
    panel.loglog(frequency, 100.0 * residual, color=BLUE, lw=0.6, label="residual")
    expected = 100.0 * measured.deviation[used] / size
    panel.loglog(frequency, expected, color=LIGHT_ORANGE, label="expected scatter")
    panel.set(xlabel="frequency in Hz", ylabel="residual, %")
    legend_above(panel, columns=2)


Draw = Callable[[Axes, AxisIdentification], None]


@styled
def creep_figure(found: Identification) -> Figure:
    """Draw the held-out error of each creep order, and the held-out residual over time."""
    return _panels(
        found, {"held-out error by order": _orders, "held-out residual": _creep_residual}
    )


@styled
def hysteresis_figure(found: Identification) -> Figure:
    """Draw the loops that F = H(u) was fitted to, and the errors on held-out loops."""
    return _panels(found, {"loops without creep and vibration": _loops, "held-out loops": _fresh})


@styled
def model_discrepancy_figure(found: Identification) -> Figure:
    """Draw the prediction residual over time, and the model discrepancy by band."""
    return _panels(found, {"prediction residual": _validation, "rms by band": _bands})


def _panels(found: Identification, panels: dict[str, Draw]) -> Figure:
    figure = blank(9.6, 2.6 * len(found.axes))
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
    panel.axhline(NANO * creep.noise, color=DARK_GREY, ls="--", label="noise of the record")
    panel.axvline(creep.order, color=ORANGE, ls=":", label="chosen order")
    panel.set(xlabel="creep elements", ylabel="sigma (Eq. 2) in nm")
    panel.legend()


def _creep_residual(panel: Axes, found: AxisIdentification) -> None:
    creep = found.report.creep
    error = next(tried.error for tried in creep.orders if tried.order == creep.order)
    dense(panel, np.arange(len(error), dtype=np.float64), NANO * error, BLUE)
    panel.set(xlabel="held-out sample", ylabel="residual in nm")


def _loops(panel: Axes, found: AxisIdentification) -> None:
    every = max(1, len(found.drive) // 40_000)
    panel.plot(found.drive[::every], found.effective[::every], color=BLUE, lw=0.4)
    panel.set(xlabel="drive u in V", ylabel="effective input F in V")


def _fresh(panel: Axes, found: AxisIdentification) -> None:
    if found.fresh is None:
        return
    samples = np.arange(len(found.fresh.exact), dtype=np.float64)
    dense(panel, samples, MILLI * found.fresh.direct, ORANGE, "direct inverse")
    dense(panel, samples, MILLI * found.fresh.exact, BLUE, "exact inverse")
    panel.set(xlabel="held-out sample", ylabel="error of u in mV")
    panel.legend()


def _validation(panel: Axes, found: AxisIdentification) -> None:
    of = found.validation
    if of is None:
        return
    seconds = of.sample_period * np.arange(len(of.residual), dtype=np.float64)
    dense(panel, seconds, NANO * of.residual, BLUE)
    panel.set(xlabel="time in s", ylabel="residual in nm")


def _bands(panel: Axes, found: AxisIdentification) -> None:
    if found.validation is None:
        return
    known = found.validation.model_discrepancy
    lines = {
        "displacement": (known.displacement, LIGHT_BLUE),
        "discrepancy": (known.rms, BLUE),
        "sensor noise": (known.noise, DARK_GREY),
    }
    edges = np.maximum(known.bands, known.bands[1] / 10.0)
    for label, (rms, colour) in lines.items():
        panel.stairs(NANO * np.array(rms), edges, color=colour, label=label)
    panel.set(xlabel="frequency in Hz", ylabel="rms in nm", xscale="log", yscale="log")
    panel.legend(fontsize=8, loc="upper right")
