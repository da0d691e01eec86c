"""Picture of the micromanipulator's loops, of their Preisach density and of the residual."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_bench.measured.micromanipulator.study import (
    JUDGED,
    MICRO,
    PERIOD,
    SAMPLE_RATE,
    SWITCHING,
    Segment,
    Study,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, GREY, LIGHT_ORANGE, ORANGE

GROWING, BACK = JUDGED[0], JUDGED[-1]


@styled
def manipulator_figure(study: Study) -> Figure:
    """Held-out loops; density; tracking error of each inverse over the held-out part."""
    figure = Figure(figsize=(9.6, 6.0), dpi=120, layout="constrained")
    figure.suptitle(
        "Piezo micromanipulator, data © 2019 Yan Naing Aye, MIT licence", x=0.01, ha="left"
    )
    grid = figure.add_gridspec(2, 2, width_ratios=(1.4, 1.0))
    _loops(figure.add_subplot(grid[0, 0]), study)
    _density(figure.add_subplot(grid[0, 1]), study)
    _errors(figure.add_subplot(grid[1, :]), study)
    return figure


def _loops(axes: Axes, study: Study) -> None:
    part = slice(GROWING.samples.start, GROWING.samples.stop + PERIOD)
    measured, predicted = (
        (signal[part] - signal[part].mean()) / MICRO for signal in (study.measured, study.predicted)
    )
    axes.plot(study.drive[part], measured, color=GREY, lw=3.0, label="measured")
    axes.plot(study.drive[part], predicted, color=BLUE, lw=0.8, label="predicted")
    axes.set(
        title=f"Loops of growing amplitude, held out, {GROWING.start:g} to {GROWING.end + 1:g} s",
        xlabel="drive in V",
        ylabel="displacement in µm",
    )
    axes.legend(loc="upper left")


def _density(axes: Axes, study: Study) -> None:
    surface = study.model.scanner.axis("x").hysteresis.surface
    mixed = -np.diff(np.diff(surface.values, axis=0), axis=1)
    cell = surface.levels[1] - surface.levels[0]
    density = np.where(np.tri(len(mixed), k=-1, dtype=bool), mixed / cell**2, np.nan)
    edges = surface.levels
    mesh = axes.pcolormesh(edges, edges, density, cmap="Blues", vmin=0.0)
    axes.figure.colorbar(mesh, ax=axes, label="density in V per V²")
    axes.set(
        title="Preisach density found", xlabel="beta in V", ylabel="alpha in V", aspect="equal"
    )


def _errors(axes: Axes, study: Study) -> None:
    axes.axvspan(SWITCHING.start, SWITCHING.end, color=GREY, lw=0.0)
    for segment in JUDGED:
        time = np.arange(segment.samples.start, segment.samples.stop) / SAMPLE_RATE
        axes.plot(time, _residual(study.measured, study, segment), color=LIGHT_ORANGE, lw=0.9)
        axes.plot(time, _residual(study.predicted_with_ours, study, segment), color=BLUE, lw=0.7)
        axes.axvline(segment.start, color=GREY, lw=0.7, zorder=0)
    axes.plot([], [], color=LIGHT_ORANGE, label="as driven")
    axes.plot([], [], color=BLUE, label="predicted with our inverse")
    axes.annotate("author's inverse takes over", (SWITCHING.end, 4.2), color=ORANGE)
    axes.set(
        title="Displacement minus desired path, mean of each segment removed",
        xlabel="time in the second file in s",
        ylabel="error in µm",
        xlim=(GROWING.start, BACK.end),
    )
    axes.legend(loc="lower right", ncols=2)


def _residual(displacement: Array, study: Study, segment: Segment) -> Array:
    error = (displacement - study.desired)[segment.samples]
    return np.asarray((error - error.mean()) / MICRO)
