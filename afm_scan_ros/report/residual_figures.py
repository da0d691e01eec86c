"""Pictures of a residual before and after: by band, time, place, speed, and against itself."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.diagnosis.describe import Description
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE, styled

NANO, MICRO = 1e9, 1e6
POINTS = 1500
"""Stretches of a drawn signal: as many as show."""
SHADES = ((ORANGE, LIGHT_ORANGE), (BLUE, LIGHT_BLUE))
NAMES = ("before", "after")
LABELS = {
    "position": (MICRO, "position in µm"),
    "speed": (1e3, "speed in mm/s"),
    "travel": (MICRO, "way since the last turn in µm"),
}


@styled
def residual_figure(floor: DetectionLimit, *stages: Description) -> Figure:
    """Draw the residual of one axis in one record: before (orange) and, if given, after (blue)."""
    figure = Figure(figsize=(9.6, 8.0), layout="constrained")
    ((bands, time), (position, speed), (last, own)) = figure.subplots(3, 2)
    bands.stairs(NANO * floor.rms, _edges(floor), color=GREY, label="floor", lw=1.4)
    for stage, colours, name in zip(stages, SHADES, NAMES, strict=False):
        bands.stairs(NANO * stage.bands, _edges(floor), color=colours[0], label=name, lw=1.4)
        _time(time, stage, colours[0])
        _dependence(position, "position", stage, colours)
        _dependence(speed, "speed", stage, colours)
        _line(last, stage, colours, name)
        own.plot(stage.own.lags, stage.own.values, color=colours[0])
    bands.set(xlabel="frequency in Hz", ylabel="rms in nm", xscale="log", yscale="log")
    _legend_above(bands)
    _correlation_bands(own, stages[-1])
    return figure


def _edges(floor: DetectionLimit) -> list[float]:
    """Edges in Hz, the first where a logarithmic axis can begin."""
    return [floor.edges[1] / 10.0, *floor.edges[1:]]


def _time(panel: Axes, stage: Description, colour: str) -> None:
    every = max(1, len(stage.residual) // POINTS)
    whole = len(stage.residual) // every * every
    stretches = NANO * stage.residual[:whole].reshape(-1, every)
    seconds = np.arange(0, whole, every) * stage.sample_period
    ends = stretches.min(axis=1), stretches.max(axis=1)
    panel.fill_between(seconds, *ends, color=colour, lw=0.4)
    panel.set(xlabel="time in s", ylabel="residual in nm")


def _dependence(panel: Axes, name: str, stage: Description, colours: tuple[str, str]) -> None:
    of, (scale, label) = stage.dependences[name], LABELS[name]
    scatter = np.sqrt(np.maximum(of.rms**2 - of.mean**2, 0.0))
    ends = NANO * (of.mean - scatter), NANO * (of.mean + scatter)
    panel.fill_between(scale * of.centres, *ends, color=colours[1], alpha=0.3, lw=0)
    panel.plot(scale * of.centres, NANO * of.mean, color=colours[0])
    panel.set(xlabel=label, ylabel="mean and scatter in nm")


def _line(panel: Axes, stage: Description, colours: tuple[str, str], name: str) -> None:
    if stage.sides is None:
        _dependence(panel, "travel", stage, colours)
        return
    ways = ("trace", stage.sides.trace), ("retrace", stage.sides.retrace)
    for (way, values), colour in zip(ways, colours, strict=True):
        label = way if name == NAMES[0] else f"{way}, {name}"
        panel.plot(stage.sides.place, NANO * values, color=colour, lw=0.9, label=label)
    panel.set(xlabel="place along the line", ylabel="mean line in nm")
    _legend_above(panel)


def _correlation_bands(panel: Axes, stage: Description) -> None:
    panel.axhspan(-stage.own.bootstrap, stage.own.bootstrap, color=GREY, alpha=0.35, lw=0)
    for sign in (-1.0, 1.0):
        panel.axhline(sign * stage.own.white, color=GREY, lw=0.8)
    panel.set(xlabel="lag in s", ylabel="autocorrelation", xscale="log", ylim=(-1.05, 1.05))


def _legend_above(panel: Axes) -> None:
    panel.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2, columnspacing=1.0
    )
