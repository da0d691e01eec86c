"""Pictures drawn by Bokeh for pages: they zoom, show values, and share axes and cursor."""

from collections.abc import Mapping, Sequence
from itertools import chain, cycle
from math import isqrt
from typing import Any, Literal

import numpy as np
from attrs import define, field, frozen
from bokeh.embed import components
from bokeh.events import Tap
from bokeh.models import (
    ColumnDataSource,
    CrosshairTool,
    CustomJS,
    DataRange1d,
    HoverTool,
    LinearColorMapper,
    Range1d,
)
from bokeh.models.annotations import ColorBar, Span
from bokeh.palettes import Greys256, RdBu11, interp_palette
from bokeh.plotting import figure
from bokeh.resources import Resources
from markupsafe import Markup

from afm_scan_ros.report.picture import (
    DARK_GREY,
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
from afm_scan_ros.report.reduction import DRAWING, coarse, thinned

TOOLS = "auto_box_zoom,pan,wheel_zoom,zoom_in,zoom_out,reset,save"
SIDES: Any = ("right", "left")
Plot = Any
"""A figure of Bokeh, whose methods make their attributes at run time."""
TOLD = "told"
"""Tag of what shows its values beside the cursor."""

KEEP_SHAPE = """
const around = cb_obj.outer_height - cb_obj.inner_height
cb_obj.height = Math.round(cb_obj.inner_width / shape + around)
"""
"""Gives an image its shape, how wide it is over how high, whatever the page's width."""
PICK_LINE = """
const [bottom, top] = line.tags, controls = [...document.querySelectorAll("[data-line-of]")];
const control = controls.find(each => line.name === `line of ${each.dataset.lineOf}`);
control.value = 1 + Math.floor(control.max * (cb_obj.y - bottom) / (top - bottom));
control.dispatchEvent(new Event("input"));
"""
"""Moves the page's own control to the line of an image that is tapped."""
SHOW_LINE = """
const values = image.data.image[0], [count, wide] = values.shape, [bottom, top] = line.tags;
const place = Math.floor(count * (line.location - bottom) / (top - bottom));
const row = Math.max(0, Math.min(count - 1, place));
source.data = {...source.data, y: values.slice(row * wide, (row + 1) * wide)};
"""
"""Shows the line of an image that is picked."""
PICK_BAND = """
const place = edges.findIndex(edge => edge > cb_obj.x);
if (place > 0) { range.setv({start: edges[place - 1], end: edges[place]}); }
"""
"""Has the spectrum show the band that is picked."""


@frozen(eq=False)
class Drawn:
    """Pictures as a page has them: the library, their data, and the place of each panel."""

    library: Markup
    data: Markup
    panels: Mapping[str, Sequence[Sequence[Markup]]]


def drawn(pictures: Sequence[Picture]) -> Drawn:
    """Draw pictures, whose names differ; a page of none needs no library."""
    if not pictures:
        return Drawn(Markup(), Markup(), {})
    images = sum(len(panel.maps) for picture in pictures for panel in picture.panels)
    finest = min(DRAWING.side, isqrt(DRAWING.pixels // max(1, images)))
    made = {picture.name: _Drawing(coarse(picture, finest)).rows() for picture in pictures}
    plots = [plot for rows in made.values() for row in rows for plot in row]
    data, places = components(plots)
    place = iter(places)
    panels = {
        name: [[Markup(next(place)) for _ in row] for row in rows]  # noqa: S704 - of Bokeh
        for name, rows in made.items()
    }
    library = Resources(mode="inline", components=["bokeh"]).render_js()
    return Drawn(Markup(library), Markup(data), panels)  # noqa: S704 - of Bokeh, which escapes


@define(eq=False)
class _Drawing:
    """A picture that is being drawn, and what its panels share."""

    picture: Picture
    ranges: dict[tuple[str, str], Any] = field(factory=dict)
    images: dict[int, ColumnDataSource] = field(factory=dict)
    cursors: dict[str, Span] = field(factory=dict)
    line: Span = field(factory=lambda: Span(dimension="width", line_color=DARK_GREY))

    def rows(self) -> list[list[Plot]]:
        """Draw each panel; each has the data of its variants, by names that the page knows."""
        rows = [[self._plot(panel) for panel in row] for row in self.picture.rows]
        for name, other in self.picture.variants.items():
            for plot, panel in zip(chain(*rows), chain(*other), strict=True):
                sources = [_source_of(mark) for mark in panel.marks]
                for number, source in enumerate(sources, start=int(panel.level is not None)):
                    source.name = f"{name}/{number}"
                plot.tags = [*plot.tags, *sources]
        self._pick_band(dict(zip((p.role for p in self.picture.panels), chain(*rows), strict=True)))
        return rows

    def _pick_band(self, plots: Mapping[str, Plot]) -> None:
        """Have a tap on a band, if there are any, show its spectrum."""
        marks = (mark for p in self.picture.panels if p.role == "bands" for mark in p.marks)
        for edges in [mark.edges for mark in marks if isinstance(mark, Steps)][:1]:
            args = {"edges": list(map(float, edges)), "range": plots["spectrum"].x_range}
            plots["bands"].js_on_event(Tap, CustomJS(args=args, code=PICK_BAND))

    def _plot(self, panel: Panel) -> Plot:
        plot = figure(
            x_axis_label=None if panel.dates else panel.x,
            y_axis_label=panel.y,
            x_axis_type="datetime" if panel.dates else _scale(panel, "x"),
            y_axis_type=_scale(panel, "y"),
            height=round(DRAWING.row * self.picture.height),
            sizing_mode="stretch_width",
            tools=TOOLS,
            active_drag="auto_box_zoom",
            active_scroll=None,
            match_aspect=panel.equal,
            min_border_left=64,
            **self._shared(panel),
        )
        plot.toolbar.update(logo=None, autohide=True)
        if panel.level is not None:  # a glyph, so that the panel's first range holds it
            plot.hspan([panel.level], line_color=GREY)
        for mark in panel.marks:
            self._add(mark, plot)
        if panel.maps and panel.x[1:] == panel.y[1:]:
            left, right, bottom, top = panel.maps[0].span
            shape = max((right - left) / (top - bottom), 1.0 / DRAWING.longest)
            args = {"shape": min(shape, DRAWING.longest)}
            plot.js_on_change("inner_width", CustomJS(args=args, code=KEEP_SHAPE))
        if panel.maps and (count := self.picture.lines):
            self._pick_line(plot, panel.maps[0], count)
        self._tell(plot, panel)
        return plot

    def _add(self, mark: Mark, plot: Plot) -> None:
        source = self._image(mark) if isinstance(mark, Map) else _source_of(mark)
        _draw(mark, plot, source)
        if isinstance(mark, PickedLine):
            args = {"line": self.line, "source": source, "image": self._image(mark.of)}
            self.line.js_on_change("location", CustomJS(args=args, code=SHOW_LINE))

    def _image(self, of: Map) -> ColumnDataSource:
        """Return an image's data, of which a page has one copy."""
        if id(of) not in self.images:
            self.images[id(of)] = _source_of(of)
        return self.images[id(of)]

    def _shared(self, panel: Panel) -> dict[str, Any]:
        """Ranges that another panel has made, or those that this one shares with others."""
        own: dict[str, Any] = {"x_range": DataRange1d(range_padding=0.0)}
        for of in panel.maps:
            left, right, bottom, top = of.span
            own["x_range"] = Range1d(start=left, end=right, bounds="auto")
            own["y_range"] = Range1d(start=bottom, end=top, bounds="auto")
        labels = {"x_range": panel.x, "y_range": panel.y}
        return {
            name: self.ranges.setdefault((name, labels[name]), made) for name, made in own.items()
        }

    def _pick_line(self, plot: Plot, of: Map, count: int) -> None:
        """Show which of so many lines is picked, and have a tap pick another."""
        bottom, top = of.span[2:]
        self.line.update(name=f"line of {self.picture.name}", tags=[bottom, top])
        self.line.location = bottom + (top - bottom) * (count // 2 + 0.5) / count
        plot.add_layout(self.line)
        plot.js_on_event(Tap, CustomJS(args={"line": self.line}, code=PICK_LINE))

    def _tell(self, plot: Plot, panel: Panel) -> None:
        """Show values beside the cursor, which panels of one label of x share."""
        told = [renderer for renderer in plot.renderers if TOLD in renderer.glyph.tags]
        if panel.maps:
            tips = [(panel.x, "$x"), (panel.y, "$y"), (panel.maps[0].label, "@image")]
            plot.add_tools(HoverTool(tooltips=tips))
        elif told:
            shown, form = ("%F %H:%M", "datetime") if panel.dates else ("%.6g", "printf")
            tips = [("", "$name"), (panel.x, f"@x{{{shown}}}"), (panel.y, "@y{%.5g}")]
            forms: Any = {"@x": form, "@y": "printf"}
            for renderer, side in zip(told, cycle(SIDES), strict=False):  # curves that coincide
                tool = HoverTool(renderers=[renderer], tooltips=tips, formatters=forms)
                tool.update(mode="vline", attachment=side, visible=False)
                plot.add_tools(tool)
        cursor = Span(dimension="height", line_color=DARK_GREY)
        cursor = self.cursors.setdefault(panel.x, cursor)
        unseen = Span(dimension="width", line_alpha=0.0)
        plot.add_tools(CrosshairTool(overlay=(cursor, unseen)))


def _scale(panel: Panel, axis: str) -> Literal["log", "linear"]:
    return "log" if axis in panel.log else "linear"


def _source_of(mark: Mark) -> ColumnDataSource:
    """Return what is drawn of a mark, by the names that ``_draw`` has for it."""
    columns: dict[str, Any]
    match mark:
        case Map():
            return ColumnDataSource({"image": [_single(mark.values)]})
        case Curve():
            shown = thinned(mark)
            columns = {"x": shown.x, "y": shown.y}
        case Steps():
            columns = {"x": mark.edges, "y": np.append(mark.values, mark.values[-1])}
        case Stretches():
            starts, ends = np.reshape(np.array(mark.ends), (-1, 2)).T
            columns = {"x0": starts, "x1": ends}
        case PickedLine():
            columns = {"x": mark.of.across, "y": mark.middle}
        case _:
            columns = {"x": mark.x, "low": mark.low, "high": mark.high}
    return ColumnDataSource({name: _single(values) for name, values in columns.items()})


def _single(values: Any) -> Any:  # noqa: ANN401 - dates too
    """Half as many bytes, of which no eye sees a difference; dates need all."""
    values = np.asarray(values)
    return values if values.dtype.kind == "M" else values.astype(np.float32)


def _draw(mark: Mark, plot: Plot, source: ColumnDataSource) -> None:
    if isinstance(mark, Map):
        _draw_map(mark, plot, source)
        return
    style = {"source": source, "color": mark.colour, **({"name": mark.name} if mark.name else {})}
    told = {**style, "tags": [TOLD]}
    match mark:
        case Curve(dots=True):
            plot.scatter("x", "y", size=4, **told)
        case Curve():
            plot.line("x", "y", line_width=mark.width, line_dash=mark.dash, **told)
        case PickedLine():
            plot.line("x", "y", line_width=1.3, **told)
        case Steps():
            plot.step("x", "y", mode="after", line_width=1.6, line_dash=mark.dash, **told)
        case Shade():
            plot.varea("x", "low", "high", alpha=0.3, **style)
        case Bars():
            plot.segment("x", "low", "x", "high", line_width=mark.width, **style)
        case Stretches():
            plot.vstrip("x0", "x1", level="underlay", fill_alpha=0.3, line_alpha=0.0, **style)


def _draw_map(mark: Map, plot: Plot, source: ColumnDataSource) -> None:
    palette = interp_palette(RdBu11, 255) if mark.signed else Greys256
    colours = LinearColorMapper(palette=palette, low=mark.low, high=mark.high)
    left, right, bottom, top = mark.span
    size = {"x": left, "y": bottom, "dw": right - left, "dh": top - bottom}
    plot.image("image", source=source, color_mapper=colours, **size)
    text = {"major_label_text_color": DARK_GREY, "title_text_color": DARK_GREY}
    shape = {"width": 10, "padding": 4, "background_fill_alpha": 0.0}
    bar = ColorBar(color_mapper=colours, title=mark.label, **text, **shape)  # type: ignore[arg-type]
    plot.add_layout(bar, "right")
