"""The style of all figures."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.rcsetup import cycler

P = ParamSpec("P")
R = TypeVar("R")

GREY, DARK_GREY = "#c9ced6", "#6b7280"
BLUE, LIGHT_BLUE = "#0b5fa5", "#86b6de"
ORANGE, LIGHT_ORANGE = "#c4501b", "#eaa987"

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
