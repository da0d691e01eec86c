"""Pictures of what was said: the confusion matrix, and how small an effect may be."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.bench.diagnosis_judge import RIGHT, SETTLED
from afm_scan_ros.bench.table import Row
from afm_scan_ros.core.catalogue import CATALOGUE
from afm_scan_ros.core.tracing.axis_trace import AMBIGUOUS, INSUFFICIENT, SUFFICIENT, UNEXPLAINED
from afm_scan_ros.report.style import BLUE, GREY, ORANGE, styled

OUTSIDE, SEVERAL = "outside the catalogue", "several"
NAMES = tuple(entry.name for entry in CATALOGUE)
TRUE = (*NAMES, OUTSIDE)
SAID = (*NAMES, SEVERAL, AMBIGUOUS, UNEXPLAINED, INSUFFICIENT, SUFFICIENT)
STEPS = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, np.inf])
"""Effect over floor, between which cases are counted together."""


@styled
def diagnosis_figure(rows: Sequence[Row]) -> Figure:
    """Truth against what was said in the end, of single effects, and shares named by size."""
    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(2.0, 1.0))
    single = [row for row in rows if row["truth"] in TRUE]
    _matrix(figure.add_subplot(grid[0]), single)
    _detection(figure.add_subplot(grid[1]), single)
    return figure


def _matrix(panel: Axes, rows: Sequence[Row]) -> None:
    counts = np.zeros((len(TRUE), len(SAID)))
    for row in rows:
        said = str(row["said"])
        column = SAID.index(said) if said in SAID else SAID.index(SEVERAL)
        counts[TRUE.index(str(row["truth"])), column] += 1
    panel.imshow(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1), cmap="Blues", vmax=1.4)
    for (i, k), count in np.ndenumerate(counts):
        if count:
            panel.text(k, i, f"{count:.0f}", ha="center", va="center", fontsize=7)
    panel.set_xticks(range(len(SAID)), [_words(s) for s in SAID], rotation=90, fontsize=7)
    panel.set_yticks(range(len(TRUE)), [_words(t) for t in TRUE], fontsize=7)
    panel.set(title="what the scanner has, against what is said of it", xlabel="said")


def _detection(panel: Axes, rows: Sequence[Row]) -> None:
    known = [row for row in rows if row["truth"] != OUTSIDE]
    ratio = np.array([row["over_floor"] for row in known], dtype=float)
    named = np.array([row["worth"] in (RIGHT, SETTLED) for row in known])
    within = np.digitize(ratio, STEPS) - 1
    for step in np.unique(within):
        here = within == step
        middle, part = np.median(ratio[here]), 100.0 * named[here].mean()
        panel.plot(middle, part, "o", color=BLUE)
        panel.annotate(f"{here.sum()}", (middle, part), (0, 5), textcoords="offset points")
    panel.axhline(95.0, color=GREY, zorder=0)
    panel.axvline(3.0, color=ORANGE, lw=0.8, zorder=0)
    panel.set(xscale="log", ylim=(-3.0, 108.0), xlabel="effect over floor (rms)")
    panel.set_title("named or settled, % (of so many)")


def _words(name: str) -> str:
    return name.replace("_", " ")
