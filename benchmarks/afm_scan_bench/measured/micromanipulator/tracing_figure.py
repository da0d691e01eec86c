"""Picture of what hysteresis alone leaves of the micromanipulator's record, and what is traced."""

from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_bench.measured.micromanipulator.study import JUDGED, MICRO, SAMPLE_RATE, SWITCHING
from afm_scan_bench.measured.micromanipulator.tracing_study import Tracing
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE, styled

OPENING = slice(0, SAMPLE_RATE // 5)
DASHES = "-", "--", ":"


@styled
def manipulator_tracing_figure(tracing: Tracing) -> Figure:
    """Errors over the part that taught nothing, and over the record's first 0.2 s."""
    figure = Figure(figsize=(9.6, 5.6), dpi=120, layout="constrained")
    figure.suptitle(
        "Piezo micromanipulator, data © 2019 Yan Naing Aye, MIT licence", x=0.01, ha="left"
    )
    grid = figure.add_gridspec(2, 1)
    chains = tracing.trace.chain, tracing.trace.extended
    before, after = (tracing.left(tracing.learnt(chain))[1] for chain in chains)
    _judged(figure.add_subplot(grid[0]), before, after)
    _opening(figure.add_subplot(grid[1]), tracing, before, after)
    return figure


def _judged(axes: Axes, before: Array, after: Array) -> None:
    axes.axvspan(SWITCHING.start, SWITCHING.end, color=GREY, lw=0.0)
    time = np.arange(len(before)) / SAMPLE_RATE
    for segment in JUDGED:
        part = segment.samples
        axes.plot(time[part], before[part] / MICRO, color=LIGHT_ORANGE, lw=0.8)
        axes.plot(time[part], after[part] / MICRO, color=BLUE, lw=0.7)
    axes.set(
        title="Measured less predicted, on what taught nothing: hysteresis alone, and as traced",
        xlabel="time in the second file in s",
        ylabel="error in µm",
        xlim=(JUDGED[0].start, JUDGED[-1].end),
    )


def _opening(axes: Axes, tracing: Tracing, before: Array, after: Array) -> None:
    time = np.arange(len(before))[OPENING] / SAMPLE_RATE
    axes.plot(time, before[OPENING] / MICRO, color=ORANGE, label="hysteresis alone")
    axes.plot(time, after[OPENING] / MICRO, color=BLUE, label="as traced")
    for competing, dashes in zip(tracing.trace.selection.competing_models, cycle(DASHES)):
        chain = tracing.learnt(competing.trial.extended(tracing.trace.chain))
        error = tracing.left(chain)[1][OPENING] / MICRO
        name = f"rival: {_named(competing.trial)}"
        axes.plot(time, error, dashes, color=LIGHT_BLUE, label=name)
    axes.set(
        title="The step at the record's start, left out of all fits, tells a lag from viscosity",
        xlabel="time in the second file in s",
        ylabel="error in µm",
    )
    axes.legend(loc="lower right")


def _named(trial: FittedCandidates) -> str:
    """Return its effects, each with its kind."""
    parts = ((each.effect.name, each.form.kind) for each in trial.candidates)
    return ", ".join(" ".join(filter(None, part)) for part in parts)
