"""Draws images as the paper does: the origin, where the scan begins, at the top right."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from afm_scan_bench.paper.picture import GRATING, Picture
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import ORANGE

MICRO, NANO = 1e6, 1e9
TALLEST = 160.0
"""Height, nm, drawn white: glass is black, chrome lies between, the dust is lightest."""

LARGE, SMALL = 3.1, 2.8
"""Sizes of a panel, inches."""


@styled
def gallery(pictures: Mapping[str, Picture], columns: int) -> Figure:
    """Draw the traces, on the expected path, each under its name."""
    rows = -(-len(pictures) // columns)
    figure = Figure(figsize=(LARGE * columns + 0.9, LARGE * rows + 0.8), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.ravel())
    for panel, (name, picture) in zip(panels, pictures.items(), strict=True):
        shown = _draw(panel, picture, picture.trace)
        panel.set_title(name)
    _frame(figure, panels, shown, columns)
    return figure


@styled
def three_ways(picture: Picture, regridded: Array) -> Figure:
    """Draw a scan's trace and retrace on the expected path, and its trace on the measured one."""
    ways = {
        "trace, on the expected path": picture.trace,
        "retrace, on the expected path": picture.retrace,
        "trace, on the measured path": regridded,
    }
    figure = Figure(figsize=(SMALL * len(ways) + 0.9, SMALL + 0.4), layout="constrained")
    panels = list(figure.subplots(1, len(ways), sharex=True, sharey=True))
    for panel, (way, image) in zip(panels, ways.items(), strict=True):
        shown = _draw(panel, picture, image)
        panel.set_title(way)
    _frame(figure, panels, shown, len(ways))
    return figure


def _draw(panel: Axes, picture: Picture, image: Array) -> AxesImage:
    left, right = MICRO * picture.columns[0], MICRO * picture.columns[-1]
    half = 0.5 * (right - left) / (len(picture.columns) - 1)
    step = 0.5 * MICRO * float(picture.rows[1] - picture.rows[0])
    last = MICRO * float(picture.rows[-1])
    shown = panel.imshow(
        NANO * image,
        cmap="gray",
        vmin=0.0,
        vmax=TALLEST,
        extent=(left - half, right + half, last + step, -step),
        interpolation="nearest",
        aspect="equal",
    )
    panel.set_facecolor("#dbe4ee")  # where the scanner never came
    _mark_bars(panel, left - half, right + half, last)
    panel.set(xlim=(right + half, left - half), ylim=(last + step, -step))
    return shown


def _mark_bars(panel: Axes, left: float, right: float, last: float) -> None:
    """Draw the true middles of the bars that pass through the image."""
    y = np.array([0.0, last])
    for bar in range(-1, 6):
        across = MICRO * (GRATING.offset + bar * GRATING.pitch)
        x = (across - y * np.sin(GRATING.angle)) / np.cos(GRATING.angle)
        if x.min() < right and x.max() > left:
            panel.plot(x, y, color=ORANGE, lw=0.9, ls=(0, (5, 4)))


def _frame(figure: Figure, panels: list[Axes], shown: AxesImage, columns: int) -> None:
    for number, panel in enumerate(panels):
        panel.spines[["top", "right"]].set_visible(True)
        if number >= len(panels) - columns:
            panel.set_xlabel("x in µm")
        if number % columns == 0:
            panel.set_ylabel("y in µm")
    bar = figure.colorbar(shown, ax=panels, shrink=0.6, aspect=30, pad=0.01)
    bar.set_label("height in nm")
    bar.outline.set_visible(False)
