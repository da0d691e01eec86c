"""The style of all figures, and pictures drawn by matplotlib, as files for papers."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.report.picture import (
    BLUE,
    GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    ORANGE,
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

P = ParamSpec("P")
R = TypeVar("R")

STYLE: Any = {
    "font.size": 9.0,
    "axes.prop_cycle": cycler(color=[BLUE, ORANGE, LIGHT_BLUE, LIGHT_ORANGE, "#6b7280", "#1f2937"]),
    "axes.edgecolor": "#6b7280",
    "axes.formatter.min_exponent": 4,  # 30 and 0.3 without powers; read when it is drawn
    "axes.labelcolor": "#1f2937",
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "date.converter": "concise",
    "figure.titlesize": 11.0,
    "legend.frameon": False,
    "legend.handlelength": 1.2,
    "lines.linewidth": 1.1,
    "savefig.facecolor": "white",
    "xtick.color": "#6b7280",
    "ytick.color": "#6b7280",
    "xtick.labelcolor": "#1f2937",
    "ytick.labelcolor": "#1f2937",
}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw in this package's style, and leave matplotlib's settings alone."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return drawn


def blank(width: float, height: float, title: str = "") -> Figure:
    """Return a figure without panels, of a size in inches."""
    figure = Figure(figsize=(width, height), layout="constrained")
    if title:
        figure.suptitle(title, x=0.01, ha="left", parse_math=False)  # a name in a file
    return figure


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
