"""Descriptions of pictures: what each panel shows, whether it is drawn on a page or in a file.

``interactive`` draws a picture on a page of a report, ``paper`` in a file for a paper.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, TypeAlias

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array

Places: TypeAlias = Array | NDArray[np.datetime64]
"""Where marks lie on the axis of x; times are dates."""
Dash: TypeAlias = Literal["solid", "dashed"]
NANO, MICRO, MILLI = 1e9, 1e6, 1e3
"""What a picture multiplies by for nm, µm and ms."""

GREY, DARK_GREY = "#b4bcc8", "#7a8494"
BLUE, LIGHT_BLUE = "#2477c9", "#86b6de"
ORANGE, LIGHT_ORANGE = "#d1541c", "#eaa987"
"""Colours that are read on white and on a dark page."""


@frozen(eq=False)
class Curve:
    """Points (n,) joined by a line, or by themselves as ``dots``; NaN interrupts it."""

    x: Places
    y: Array
    name: str = ""
    colour: str = BLUE
    width: float = 1.1
    dots: bool = False
    dash: Dash = "solid"


@frozen(eq=False)
class Shade:
    """The area between two curves over ``x`` (n,), as the mean ± one standard deviation."""

    x: Places
    low: Array
    high: Array
    name: str = ""
    colour: str = GREY


@frozen(eq=False)
class Steps:
    """Values (n,) that hold between ``edges`` (n + 1,), as an rms by frequency band."""

    edges: Array
    values: Array
    name: str = ""
    colour: str = BLUE
    dash: Dash = "solid"


@frozen(eq=False)
class Bars:
    """Intervals ``low`` to ``high`` (n,) at ``x``."""

    x: Places
    low: Array
    high: Array
    name: str = ""
    colour: str = BLUE
    width: float = 1.1


@frozen(eq=False)
class Stretches:
    """Stretches of x, (start, end) each, that are set apart."""

    ends: Sequence[tuple[float, float] | NDArray[np.datetime64]]
    name: str = ""
    colour: str = GREY


@frozen(eq=False)
class Map:
    """An image: values (lines, pixels), the lowest line first.

    ``span`` is its left, right, bottom and top. Its colours go from ``low`` to ``high``; values
    that are ``signed``, as errors, have zero in the middle of them. On a page that has fewer pixels
    each shows the mean of some, or the largest of them where the image is of ``peaks``.
    """

    values: Array
    span: tuple[float, float, float, float]
    label: str
    low: float
    high: float
    signed: bool = False
    peaks: bool = False

    @property
    def across(self) -> Array:
        """Middle of each pixel."""
        left, right, *_ = self.span
        edges = np.linspace(left, right, self.values.shape[1] + 1)
        result: Array = 0.5 * (edges[1:] + edges[:-1])
        return result


@frozen(eq=False)
class PickedLine:
    """The line of an image that is picked, over its pixels; in a file, the middle one."""

    of: Map
    name: str = ""
    colour: str = BLUE

    @property
    def middle(self) -> Array:
        """The middle line."""
        result: Array = self.of.values[len(self.of.values) // 2]
        return result


Mark: TypeAlias = Curve | Shade | Steps | Bars | Stretches | Map | PickedLine


@frozen(eq=False)
class Panel:
    """Marks on common axes.

    ``log`` names the axes that are logarithmic. A line is drawn at a ``level``. A band that is
    picked in a panel of ``bands`` is what the panel of its ``spectrum`` shows.
    """

    marks: Sequence[Mark]
    x: str
    y: str
    title: str = ""
    log: Literal["", "x", "y", "xy"] = ""
    level: float | None = None
    dates: bool = False
    equal: bool = False
    role: Literal["", "bands", "spectrum"] = ""

    @property
    def maps(self) -> list[Map]:
        """The images it shows."""
        return [mark for mark in self.marks if isinstance(mark, Map)]


def image_row(maps: Sequence[Map], titles: Sequence[str], x: str, y: str) -> list[Panel]:
    """Return a panel for each image."""
    return [Panel([of], x, y, title) for of, title in zip(maps, titles, strict=True)]


def picked_lines(
    maps: Sequence[Map], names: Sequence[str], colours: Sequence[str] = (BLUE, ORANGE)
) -> list[PickedLine]:
    """Return the line that is picked of each of two images."""
    return [PickedLine(*each) for each in zip(maps, names, colours, strict=True)]


PanelRows: TypeAlias = Sequence[Sequence[Panel]]


@frozen(eq=False)
class Picture:
    """Rows of panels. Panels with one label of x, and images with one label of y, zoom together.

    ``name`` is that of its file, ``height`` that of a row over the common one. ``variants`` are
    other rows of the same panels and marks, by name, of which a page shows one at a time; the first
    of them are the ``rows``.
    """

    name: str
    caption: str
    rows: PanelRows
    height: float = 1.0
    title: str = field(default="", kw_only=True)
    variants: Mapping[str, PanelRows] = field(factory=dict, kw_only=True)

    @property
    def panels(self) -> list[Panel]:
        """Every panel, row by row."""
        return [panel for row in self.rows for panel in row]

    def singly(self) -> Iterator["Picture"]:
        """Yield a picture of each variant; itself where there is none."""
        if not self.variants:
            yield self
        for name, rows in self.variants.items():
            yield evolve(self, name=f"{self.name}_{name}", title=name, rows=rows, variants={})

    @property
    def lines(self) -> int:
        """Lines among which one is picked; 0 where the picture shows no image of lines."""
        picked = (m.of for p in self.panels for m in p.marks if isinstance(m, PickedLine))
        return next((len(of.values) for of in picked), 0)
