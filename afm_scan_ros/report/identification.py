"""What an identification found, as numbers for JSON and as one picture."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.identification.fit_report import AxisReport
from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.identification.recording import Misfit
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.style import styled

POINTS = 20_000
"""Points of a drawn loop: as many as show."""


def fit_summary(identification: Identification) -> dict[str, Any]:
    """Return the fit report by axis: what was fitted, the paper's figures of merit, warnings."""
    return {axis: _axis_summary(getattr(identification, axis).report) for axis in AXES}


def _axis_summary(report: AxisReport) -> dict[str, Any]:
    vibration = report.vibration
    return {
        "creep": {
            "record": "creep: first hold fitted, second held out",
            "gains": report.creep.model.gains,
            "time_constants_s": report.creep.model.time_constants,
            "fitted": _misfit(report.creep.fitted, "m"),
            "held_out": _misfit(report.creep.held_out, "m"),
        },
        "vibration": {
            "record": "frequency: response to F = H(u) behind the converter's hold",
            "resonance_hz": vibration.resonance,
            "damping": vibration.damping,
            "band_hz": vibration.band,
            "relative_misfit_rms": vibration.misfit,
            "gain_over_gauge": vibration.gain_ratio,
        },
        "hysteresis": {
            "record": "hysteresis: reversal curves fitted, the loops after them held out",
            "drive_range_v": report.drive_range,
            "effective_range_v": report.effective_range,
            "closure_v": report.closure,
            "exact_inverse_held_out": _misfit(report.exact, "v"),
            "direct_inverse_held_out": _misfit(report.direct, "v"),
        },
        "rounds": report.rounds,
        "last_change": report.change,
        "warnings": report.warnings,
    }


def _misfit(misfit: Misfit, unit: str) -> dict[str, float]:
    return {
        f"sigma_{unit}": misfit.sigma,
        f"max_{unit}": misfit.maximum,
        "samples": misfit.samples,
    }


@styled
def fit_figure(identification: Identification) -> Figure:
    """Draw, axis by axis, the loops, the frequency response and the creep that were found."""
    figure = Figure(figsize=(13, 7), layout="constrained")
    for row, axis in zip(figure.subplots(2, 3), AXES, strict=True):
        found: AxisIdentification = getattr(identification, axis)
        _draw_loops(row[0], found)
        _draw_response(row[1], found)
        _draw_creep(row[2], found)
        row[0].set_title(f"{axis}: hysteresis, freed of creep and vibration")
        row[1].set_title(f"{axis}: vibration from F")
        row[2].set_title(f"{axis}: creep after a step")
    return figure


def _draw_loops(panel: Axes, found: AxisIdentification) -> None:
    every = max(1, len(found.drive) // POINTS)
    panel.plot(found.drive[::every], found.effective[::every], linewidth=0.4)
    panel.set(xlabel="drive u [V]", ylabel="effective input F [V]")


def _draw_response(panel: Axes, found: AxisIdentification) -> None:
    frequency = found.response.omega / (2.0 * np.pi)
    gauge = found.model.vibration.static_gain * found.report.vibration.gain_ratio
    model = found.model.vibration.response(found.response.omega)
    scale = found.model.vibration.static_gain
    panel.loglog(frequency, np.abs(found.response.response) / gauge, ".", ms=2, label="measured")
    panel.loglog(frequency, np.abs(model) / scale, linewidth=1, label="model")
    panel.axvspan(found.report.vibration.band[1], frequency[-1], alpha=0.1, label="not fitted")
    panel.set(xlabel="frequency [Hz]", ylabel="|G| / G(0)")
    panel.legend()


def _draw_creep(panel: Axes, found: AxisIdentification) -> None:
    creep = found.model.creep
    seconds = np.geomspace(0.1, 10.0 * max(creep.time_constants), 400)
    response = 1.0 + sum(
        gain * -np.expm1(-seconds / tau)
        for gain, tau in zip(creep.gains, creep.time_constants, strict=True)
    )
    panel.semilogx(seconds, response)
    panel.set(xlabel="time after the step [s]", ylabel="displacement / its first instant")
