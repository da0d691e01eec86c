"""Pictures drawn by matplotlib, as files for papers."""

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.report.picture import (
    GREY,
    Bars,
    Curve,
    Map,
    Mark,
    Panel,
    PickedLine,
    Picture,
    Shade,
    Steps,
    Stretches,
)
from afm_scan_ros.report.reduction import thinned
from afm_scan_ros.report.style import blank, styled

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
    if axes.get_legend_handles_labels()[0]:
        place: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 3}
        axes.legend(**place, borderaxespad=0.2, columnspacing=1.0, fontsize=8)


def _draw(mark: Mark, axes: Axes) -> None:
    if isinstance(mark, Map):
        _draw_map(mark, axes)
        return
    style: Any = {"color": mark.colour, "label": mark.name or None}
    match mark:
        case Curve(dots=True):
            shown = thinned(mark)
            axes.plot(shown.x, shown.y, ls="", marker="o", ms=2.5, **style)
        case Curve():
            shown = thinned(mark)
            axes.plot(shown.x, shown.y, lw=mark.width, ls=mark.dash, **style)
        case PickedLine():
            axes.plot(mark.of.across, mark.middle, lw=1.1, **style)
        case Steps():
            axes.stairs(mark.values, mark.edges, ls=mark.dash, lw=1.4, **style)
        case Shade():
            axes.fill_between(mark.x, mark.low, mark.high, alpha=0.3, lw=0, **style)
        case Bars():
            axes.vlines(mark.x, mark.low, mark.high, lw=mark.width, **style)
        case Stretches():
            for start, end in mark.ends:
                axes.axvspan(start, end, alpha=0.35, lw=0, **style)
                style = {"color": mark.colour}


def _draw_map(mark: Map, axes: Axes) -> None:
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
