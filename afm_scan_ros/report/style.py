"""The style of all figures, and what several of them draw alike."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from afm_scan_ros.report.picture import BLUE, LIGHT_BLUE, LIGHT_ORANGE, ORANGE

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
