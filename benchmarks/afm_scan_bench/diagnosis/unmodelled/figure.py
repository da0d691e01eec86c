"""Figures of the diagnosis: the confusion matrix, and the share named by size."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_bench.diagnosis.unmodelled.cases import NOISES
from afm_scan_bench.diagnosis.unmodelled.judge import CLEAR, CORRECT, RESOLVED
from afm_scan_bench.mechanisms.product_sizes import SIZES
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    INSUFFICIENT,
    SUFFICIENT,
    UNEXPLAINED,
)
from afm_scan_ros.core.effects.registry import CATALOGUE
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, GREY, LIGHT_BLUE, ORANGE
from afm_scan_ros.report.table import Row

OUTSIDE, SEVERAL = "outside the catalogue", "several"
NAMES = tuple(entry.name for entry in CATALOGUE)
TRUE = (*NAMES, OUTSIDE)
STATED = (*NAMES, SEVERAL, AMBIGUOUS, UNEXPLAINED, INSUFFICIENT, SUFFICIENT)
HALF = 50.0
STEPS = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, np.inf])
"""Edges of the bins of effect over detection limit."""

LEGIBLE = 0.6
"""Share up to which black can be read on its blue."""


@styled
def diagnosis_figure(rows: Sequence[Row]) -> Figure:
    """Truth against final verdict of single effects, and the share named by size."""
    figure = Figure(figsize=(9.6, 7.2), dpi=150, layout="constrained")
    figure.suptitle("True effect (rows) and diagnosis (columns)", x=0.01, ha="left")
    single = [row for row in rows if row["truth"] in TRUE]
    panels = [figure.add_subplot(2, 2, k) for k in (1, 2, 3, 4)]
    for panel, size in zip(panels, SIZES, strict=False):
        _matrix(panel, [row for row in single if row["size"] == size])
        panel.set_title(size)
    _detection(panels[-1], [row for row in single if row["truth"] != OUTSIDE])
    return figure


def _matrix(panel: Axes, rows: Sequence[Row]) -> None:
    counts = np.zeros((len(TRUE), len(STATED)))
    for row in rows:
        stated = str(row["stated"])
        column = STATED.index(stated) if stated in STATED else STATED.index(SEVERAL)
        counts[TRUE.index(str(row["truth"])), column] += 1
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    panel.imshow(shares, cmap="Blues", vmax=1.4)
    for i, k in np.argwhere(counts):
        colour = "white" if shares[i, k] > LEGIBLE else "black"
        count = f"{counts[i, k]:.0f}"
        panel.text(k, i, count, color=colour, ha="center", va="center", fontsize=6)
    panel.set_xticks(range(len(STATED)), [_readable(s) for s in STATED], rotation=90, fontsize=6)
    panel.set_yticks(range(len(TRUE)), [_readable(t) for t in TRUE], fontsize=6)


def _detection(panel: Axes, rows: Sequence[Row]) -> None:
    """Each case as a mark, above if it was named, and the share named by ratio."""
    ratio = np.array([row["ratio"] for row in rows], dtype=float)
    noise = np.array([row["noise"] for row in rows], dtype=float)
    named = np.array([row["answer"] in (CORRECT, RESOLVED) for row in rows])
    for factor, colour in zip(NOISES, (LIGHT_BLUE, BLUE, ORANGE), strict=True):
        here = noise == factor
        height, name = np.where(named, 106.0, -6.0)[here], f"{factor:g} times the noise"
        panel.plot(ratio[here], height, "|", color=colour, label=name)
    within = np.digitize(ratio, STEPS)
    for turn, step in enumerate(np.unique(within)):
        here = within == step
        middle, part = np.median(ratio[here]), 100.0 * named[here].mean()
        panel.plot(middle, part, "o", color=BLUE, ms=4)
        # Neighbours may lie closer than a word is wide, and the rows of ticks above and below.
        beside = (4, (-10, -20)[turn % 2] if part > HALF else 4)
        panel.annotate(f"of {here.sum()}", (middle, part), beside, textcoords="offset points")
    panel.axvline(CLEAR, color=GREY, zorder=0)
    panel.set(
        xscale="log",
        xlim=(0.8, 200.0),
        ylim=(-12.0, 112.0),
        xlabel="ratio: effect over detection limit (rms)",
    )
    panel.set_title("correct or resolved, % of cases")
    panel.legend(loc="center right")


def _readable(name: str) -> str:
    return name.replace("_", " ")
