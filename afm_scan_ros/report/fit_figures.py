"""Pictures of an identification: responses, creep, loops, residuals and discrepancy."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.identification.fitted_axis import FittedAxis
from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.core.identification.local_response import Complex
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.style import (
    BLUE,
    DARK_GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    NANO,
    ORANGE,
    blank,
    dense,
    styled,
)

COLOURS = (LIGHT_BLUE, LIGHT_ORANGE, DARK_GREY)
"""Of records, in turn."""
COHERENCE = 0.9
"""Least coherence of a measured line that is drawn."""
POINTS = 400
"""Points of a model's curve."""
HALF_TURN = 180.0
"""Degrees from one point to the next at which a curve of the phase is cut."""

Draw = Callable[[Axes, FittedAxis], None]


@styled
def response_figure(found: Identification) -> Figure:
    """Draw magnitude and phase of the response to F, of each record and of the model."""
    return _panels(found, {"magnitude": _magnitude, "phase": _phase})


@styled
def slow_figure(found: Identification) -> Figure:
    """Draw the creep after a step, and the loops of F = H(u)."""
    return _panels(found, {"creep after a step": _creep, "loops": _loops})


@styled
def residual_figure(found: Identification) -> Figure:
    """Draw what the model leaves of each record over time, and its discrepancy by band."""
    return _panels(found, {"left of each record": _left, "held out, rms by band": _bands})


def _panels(found: Identification, panels: dict[str, Draw]) -> Figure:
    figure = blank(9.6, 3.2 * len(found.axes))
    grid = figure.subplots(len(found.axes), len(panels), squeeze=False)
    for row, (name, axis) in zip(grid, found.axes.items(), strict=True):
        for panel, (title, draw) in zip(row, panels.items(), strict=True):
            draw(panel, axis)
            panel.set_title(f"{name}: {title}")
    return figure


def _response(model: AxisModel, frequency: Array, sample_period: float) -> Complex:
    """Complex response (m/V) from F to what the sensor reads, creep included, at Hz."""
    omega = 2.0 * np.pi * frequency
    gains, constants = np.array(model.creep.gains), np.array(model.creep.time_constants)
    creep = 1.0 + np.sum(gains / (1.0 + 1j * omega[:, np.newaxis] * constants), axis=1)
    return np.asarray(creep * held(model.read_vibration, sample_period).response(omega))


def _magnitude(panel: Axes, found: FittedAxis) -> None:
    _responses(panel, found, lambda response: MICRO * np.abs(response))
    panel.set(yscale="log", ylabel="response to F in µm/V")
    panel.legend(fontsize=8, loc="lower left", markerscale=4.0)


def _phase(panel: Axes, found: FittedAxis) -> None:
    _responses(panel, found, lambda response: np.degrees(np.angle(response)))
    panel.set(ylabel="phase in degrees", yticks=np.arange(-180.0, 181.0, 90.0))


def _responses(panel: Axes, found: FittedAxis, of: Callable[[Complex], Array]) -> None:
    """Draw a figure ``of`` the responses of all records, and of the model over their band."""
    for k, record in enumerate(found.records):
        measured = record.response
        clear = measured.coherence > COHERENCE
        panel.plot(
            measured.frequency[clear],
            of(measured.response[clear]),
            ".",
            ms=2.5,
            color=COLOURS[k % len(COLOURS)],
            label=record.name,
        )
    shortest = min(found.records, key=lambda record: record.sample_period)
    highest = 0.5 / shortest.sample_period
    lowest = min(float(r.response.frequency.min(initial=highest)) for r in found.records)
    frequency = np.geomspace(min(lowest, 0.01 * highest), highest, POINTS)
    curve = of(_response(found.model, frequency, shortest.sample_period))
    turned = np.abs(np.diff(curve, prepend=curve[0])) > HALF_TURN
    panel.plot(frequency, np.where(turned, np.nan, curve), color=BLUE, label="model")
    panel.set(xscale="log", xlabel="frequency in Hz")


def _creep(panel: Axes, found: FittedAxis) -> None:
    creep = found.model.creep
    held_for = np.geomspace(1e-4, 3.0, POINTS) * max(creep.time_constants, default=1.0)
    grown = -np.expm1(-held_for[:, np.newaxis] / np.array(creep.time_constants))
    panel.semilogx(held_for, 100.0 * grown @ np.array(creep.gains), color=BLUE)
    panel.set(xlabel="time since a step in s", ylabel="creep in % of the step")


def _loops(panel: Axes, found: FittedAxis) -> None:
    for k, record in enumerate(found.records):
        every = max(1, len(record.drive) // 40_000)
        colour = COLOURS[k % len(COLOURS)]
        panel.plot(record.drive[::every], record.effective[::every], color=colour, lw=0.4)
    panel.set(xlabel="drive u in V", ylabel="effective input F in V")


def _left(panel: Axes, found: FittedAxis) -> None:
    for k, record in enumerate(found.records):
        share = record.seconds / record.seconds[-1]
        dense(panel, share, NANO * record.left, COLOURS[k % len(COLOURS)], record.name)
    for one in found.validations:
        share = np.linspace(0.0, 1.0, len(one.residual))
        dense(panel, share, NANO * one.residual, ORANGE, f"{one.record}, held out")
    panel.set(xlabel="time over the record's length", ylabel="measured less model, nm")
    panel.legend(fontsize=8, loc="best")


def _bands(panel: Axes, found: FittedAxis) -> None:
    for one in found.validations[:1]:
        known = one.model_discrepancy
        lines = {
            "displacement": (known.displacement, LIGHT_BLUE),
            "discrepancy": (known.rms, BLUE),
            "sensor noise": (known.noise, DARK_GREY),
        }
        edges = np.maximum(known.bands, known.bands[1] / 10.0)
        for label, (rms, colour) in lines.items():
            shown = NANO * np.where(np.array(rms) >= min(known.noise), rms, np.nan)
            panel.stairs(shown, edges, color=colour, label=label)
        panel.set(xlabel="frequency in Hz", ylabel="rms in nm", xscale="log", yscale="log")
        panel.legend(fontsize=8, loc="upper right")
