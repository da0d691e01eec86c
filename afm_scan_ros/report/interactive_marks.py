"""Marks of pictures drawn by Bokeh."""

from functools import singledispatch
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, LinearColorMapper
from bokeh.models.annotations import ColorBar
from bokeh.palettes import Greys256, RdBu11, interp_palette

from afm_scan_ros.report.picture import (
    DARK_GREY,
    Bars,
    Curve,
    Map,
    Mark,
    PickedLine,
    Shade,
    Steps,
    Stretches,
)
from afm_scan_ros.report.reduction import thinned

Plot = Any
"""A figure of Bokeh, whose methods make their attributes at run time."""
TOLD = "told"
"""Tag of what shows its values beside the cursor."""


def _single(values: Any) -> Any:  # noqa: ANN401 - dates too
    """Half as many bytes, of which no eye sees a difference; dates need all."""
    values = np.asarray(values)
    return values if values.dtype.kind == "M" else values.astype(np.float32)


@singledispatch
def _columns(mark: Any) -> dict[str, Any]:  # noqa: ANN401 - of whatever kind is registered
    """Return what is drawn of a mark, by the names that ``_draw`` has for it."""
    return {"x": mark.x, "low": mark.low, "high": mark.high}


@_columns.register
def _(mark: Curve) -> dict[str, Any]:
    shown = thinned(mark)
    return {"x": shown.x, "y": shown.y}


@_columns.register
def _(mark: Steps) -> dict[str, Any]:
    return {"x": mark.edges, "y": np.append(mark.values, mark.values[-1])}


@_columns.register
def _(mark: Stretches) -> dict[str, Any]:
    starts, ends = np.reshape(np.array(mark.ends), (-1, 2)).T
    return {"x0": starts, "x1": ends}


@_columns.register
def _(mark: Map) -> dict[str, Any]:
    return {"image": [mark.values]}


@_columns.register
def _(mark: PickedLine) -> dict[str, Any]:
    return {"x": mark.of.across, "y": mark.of.values[len(mark.of.values) // 2]}


def source_of(mark: Mark) -> ColumnDataSource:
    """Return what is drawn of a mark, as Bokeh has it."""
    columns = _columns(mark)
    return ColumnDataSource(
        {
            name: [_single(v) for v in values] if isinstance(values, list) else _single(values)
            for name, values in columns.items()
        }
    )


def _style(mark: Any, source: ColumnDataSource, **more: object) -> dict[str, Any]:  # noqa: ANN401 - any but Map
    named = {"name": mark.name} if mark.name else {}
    return {"source": source, "color": mark.colour, **named, **more}


@singledispatch
def draw(mark: Any, plot: Plot, source: ColumnDataSource) -> None:  # noqa: ANN401 - as above
    """Draw a mark on a figure."""
    raise TypeError(f"{type(mark).__name__} is no mark, for {plot} and {source}")


@draw.register
def _(mark: Curve, plot: Plot, source: ColumnDataSource) -> None:
    if mark.dots:
        plot.scatter("x", "y", size=4, **_style(mark, source, tags=[TOLD]))
    else:
        dash = "dashed" if mark.dashed else "solid"
        style = _style(mark, source, tags=[TOLD], line_width=mark.width, line_dash=dash)
        plot.line("x", "y", **style)


@draw.register
def _(mark: Shade, plot: Plot, source: ColumnDataSource) -> None:
    plot.varea("x", "low", "high", **_style(mark, source, alpha=0.3))


@draw.register
def _(mark: Steps, plot: Plot, source: ColumnDataSource) -> None:
    dash = "dashed" if mark.dashed else "solid"
    style = _style(mark, source, tags=[TOLD], line_width=1.6, line_dash=dash)
    plot.step("x", "y", mode="after", **style)


@draw.register
def _(mark: Bars, plot: Plot, source: ColumnDataSource) -> None:
    plot.segment("x", "low", "x", "high", **_style(mark, source, line_width=mark.width))


@draw.register
def _(mark: Stretches, plot: Plot, source: ColumnDataSource) -> None:
    style = _style(mark, source, level="underlay", fill_alpha=0.3, line_alpha=0.0)
    plot.vstrip("x0", "x1", **style)


@draw.register
def _(mark: Map, plot: Plot, source: ColumnDataSource) -> None:
    palette = interp_palette(RdBu11, 255) if mark.signed else Greys256
    colours = LinearColorMapper(palette=palette, low=mark.low, high=mark.high)
    size = {"dw": mark.right - mark.left, "dh": mark.top - mark.bottom}
    corner = {"x": mark.left, "y": mark.bottom}
    plot.image("image", source=source, color_mapper=colours, **corner, **size)
    text = {"major_label_text_color": DARK_GREY, "title_text_color": DARK_GREY}
    shape = {"width": 10, "padding": 4, "background_fill_alpha": 0.0}
    bar = ColorBar(color_mapper=colours, title=mark.label, **text, **shape)  # type: ignore[arg-type]
    plot.add_layout(bar, "right")


@draw.register
def _(mark: PickedLine, plot: Plot, source: ColumnDataSource) -> None:
    plot.line("x", "y", **_style(mark, source, tags=[TOLD], line_width=1.3))
