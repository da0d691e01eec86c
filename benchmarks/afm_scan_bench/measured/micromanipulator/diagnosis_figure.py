"""Figure of the micromanipulator's residual with hysteresis alone and with the selected effects."""

from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_bench.measured.micromanipulator.diagnosis_study import ManipulatorDiagnosis
from afm_scan_bench.measured.micromanipulator.study import JUDGED, MICRO, SAMPLE_RATE, SWITCHING
from afm_scan_ros.core.diagnosis.axis_diagnosis import CERTAIN
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE, styled

OPENING = slice(0, SAMPLE_RATE // 5)
DASHES = "-", "--", ":"


@styled
def manipulator_diagnosis_figure(study: ManipulatorDiagnosis) -> Figure:
    """Errors over the held-out part, and over the record's first 0.2 s."""
    figure = Figure(figsize=(9.6, 5.6), dpi=120, layout="constrained")
    figure.suptitle(
        "Piezo micromanipulator, data © 2019 Yan Naing Aye, MIT licence", x=0.01, ha="left"
    )
    grid = figure.add_gridspec(2, 1)
    chains = study.diagnosis.chain, study.diagnosis.extended
    before, after = (study.left(study.learnt(chain))[1] for chain in chains)
    _judged(figure.add_subplot(grid[0]), before, after)
    _opening(figure.add_subplot(grid[1]), study, before, after)
    return figure


def _judged(axes: Axes, before: Array, after: Array) -> None:
    axes.axvspan(SWITCHING.start, SWITCHING.end, color=GREY, lw=0.0)
    time = np.arange(len(before)) / SAMPLE_RATE
    for segment in JUDGED:
        part = segment.samples
        axes.plot(time[part], before[part] / MICRO, color=LIGHT_ORANGE, lw=0.8)
        axes.plot(time[part], after[part] / MICRO, color=BLUE, lw=0.7)
    axes.set(
        title="Measured minus predicted, held-out part: hysteresis alone, and selected effects",
        xlabel="time in the second file in s",
        ylabel="error in µm",
        xlim=(JUDGED[0].start, JUDGED[-1].end),
    )


def _opening(axes: Axes, study: ManipulatorDiagnosis, before: Array, after: Array) -> None:
    time = np.arange(len(before))[OPENING] / SAMPLE_RATE
    axes.plot(time, before[OPENING] / MICRO, color=ORANGE, label="hysteresis alone")
    axes.plot(time, after[OPENING] / MICRO, color=BLUE, label="selected effects")
    for competing, dashes in zip(
        study.diagnosis.selection.posterior.competing(CERTAIN), cycle(DASHES)
    ):
        chain = study.learnt(competing.extended(study.diagnosis.chain))
        error = study.left(chain)[1][OPENING] / MICRO
        name = f"competing: {_named(competing)}"
        axes.plot(time, error, dashes, color=LIGHT_BLUE, label=name)
    axes.set(
        title="Step at the record's start, held out: a lag differs from viscous hysteresis",
        xlabel="time in the second file in s",
        ylabel="error in µm",
    )
    axes.legend(loc="lower right")


def _named(trial: FittedCandidates) -> str:
    """Return its effects, each with its kind."""
    parts = ((each.effect.name, each.form.kind) for each in trial.candidates)
    return ", ".join(" ".join(filter(None, part)) for part in parts)
