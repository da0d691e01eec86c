"""Pictures drawn by matplotlib, as files for papers."""

from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.report.picture import (
    GREY,
    Bars,
    Curve,
    Map,
    Panel,
    PickedLine,
    Picture,
    Shade,
    Steps,
    Stretches,
)
from afm_scan_ros.report.reduction import thinned
from afm_scan_ros.report.style import blank, legend_above, styled

FORMATS = ("pdf", "svg", "png")
WIDTH, ROW = 9.6, 2.4
"""Inches of a figure, and of a row of panels."""


@styled
def paper_figure(picture: Picture) -> Figure:
    """Draw a picture by matplotlib."""
    columns = max(map(len, picture.rows))
    figure = blank(WIDTH, ROW * picture.height * len(picture.rows), picture.title)
    grid = figure.add_gridspec(len(picture.rows), columns)
    shared: dict[str, Axes] = {}
    for number, row in enumerate(picture.rows):
        for place, panel in enumerate(row):
            wide = slice(place, None) if len(row) == 1 else place
            axes = figure.add_subplot(grid[number, wide], sharex=shared.get(panel.x))
            shared.setdefault(panel.x, axes)
            _draw_panel(axes, panel)
    return figure


@styled
def save(figure: Figure, path: Path) -> None:
    """Write a figure to a file whose suffix gives the format, as ``.png`` or ``.svg``.

    Raises InputError for an ending that is none of a picture.
    """
    known = figure.canvas.get_supported_filetypes()
    if path.suffix.removeprefix(".") not in known:
        raise InputError(f"{path}: unknown kind of picture: end it in .png, .svg or .pdf")
    with replacing(path) as beside:
        figure.savefig(beside, dpi=160)


def _draw_panel(axes: Axes, panel: Panel) -> None:
    axes.set(xlabel=panel.x, ylabel=panel.y, title=panel.title)
    if "x" in panel.log:
        axes.set_xscale("log")
    if "y" in panel.log:
        axes.set_yscale("log")
    if panel.equal:
        axes.set_aspect("equal")
    if panel.level is not None:
        axes.axhline(panel.level, color=GREY, lw=0.6, zorder=0)
    for mark in panel.marks:
        _draw(mark, axes)
    if panel.dates:
        axes.xaxis_date()
    legend_above(axes)


@singledispatch
def _draw(mark: object, axes: Axes) -> None:
    raise TypeError(f"{type(mark).__name__} is no mark, for {axes}")


@_draw.register
def _(mark: Curve, axes: Axes) -> None:
    shown = thinned(mark)
    style: Any = {"lw": mark.width, "ls": "--" if mark.dashed else "-"}
    if mark.dots:
        style = {"ls": "", "marker": "o", "ms": 2.5}
    axes.plot(shown.x, shown.y, color=mark.colour, label=mark.name or None, **style)


@_draw.register
def _(mark: Shade, axes: Axes) -> None:
    label = mark.name or None
    axes.fill_between(mark.x, mark.low, mark.high, color=mark.colour, alpha=0.3, lw=0, label=label)


@_draw.register
def _(mark: Steps, axes: Axes) -> None:
    style = "--" if mark.dashed else "-"
    axes.stairs(mark.values, mark.edges, color=mark.colour, ls=style, lw=1.4, label=mark.name)


@_draw.register
def _(mark: Bars, axes: Axes) -> None:
    style: Any = {"lw": mark.width, "label": mark.name or None}
    axes.vlines(mark.x, mark.low, mark.high, color=mark.colour, **style)


@_draw.register
def _(mark: Stretches, axes: Axes) -> None:
    label: str | None = mark.name
    for start, end in mark.ends:
        axes.axvspan(start, end, color=mark.colour, alpha=0.35, lw=0, label=label)
        label = None


@_draw.register
def _(mark: Map, axes: Axes) -> None:
    drawn = axes.imshow(
        mark.values,
        cmap="RdBu_r" if mark.signed else "gray",
        vmin=mark.low,
        vmax=mark.high,
        origin="lower",
        extent=mark.span,
        aspect="auto",
    )
    axes.figure.colorbar(drawn, ax=axes, label=mark.label)


@_draw.register
def _(mark: PickedLine, axes: Axes) -> None:
    middle = len(mark.of.values) // 2
    values = np.asarray(mark.of.values)[middle]
    axes.plot(mark.of.across, values, color=mark.colour, lw=1.1, label=mark.name)
