"""Pictures drawn by Bokeh for pages: they zoom, show values, and share axes and cursor."""

from collections.abc import Mapping, Sequence
from itertools import chain, cycle
from math import isqrt
from typing import Any, Literal

from attrs import define, field, frozen
from bokeh.embed import components
from bokeh.events import Tap
from bokeh.models import (
    ColumnDataSource,
    CrosshairTool,
    CustomJS,
    DataRange1d,
    HoverTool,
    Range1d,
)
from bokeh.models.annotations import Span
from bokeh.plotting import figure
from bokeh.resources import Resources
from markupsafe import Markup

from afm_scan_ros.report.drawing_settings import DRAWING
from afm_scan_ros.report.interactive_marks import TOLD, Plot, draw, source_of
from afm_scan_ros.report.picture import (
    DARK_GREY,
    GREY,
    Map,
    Mark,
    Panel,
    PickedLine,
    Picture,
    Steps,
)
from afm_scan_ros.report.reduction import coarse

TOOLS = "auto_box_zoom,pan,wheel_zoom,zoom_in,zoom_out,reset,save"
SIDES: Any = ("right", "left")

PICK_LINE = """
const values = image.data.image[0], [count, wide] = values.shape;
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
        """Draw each panel."""
        rows = [[self._plot(panel) for panel in row] for row in self.picture.rows]
        self._add_variants(rows)
        pairs = zip(self.picture.panels, chain.from_iterable(rows), strict=True)
        plots = {panel.role: plot for panel, plot in pairs}
        if "bands" in plots and "spectrum" in plots:
            args = {"edges": self._edges(), "range": plots["spectrum"].x_range}
            plots["bands"].js_on_event(Tap, CustomJS(args=args, code=PICK_BAND))
        return rows

    def _add_variants(self, rows: list[list[Plot]]) -> None:
        """Give the page the data of each variant, under the number of what they replace."""
        for name, other in self.picture.variants.items():
            for plot, panel in zip(chain(*rows), chain(*other), strict=True):
                sources = [source_of(mark) for mark in panel.marks]
                for number, source in enumerate(sources):
                    source.name = f"{name}/{number}"
                plot.tags = [*plot.tags, *sources]

    def _edges(self) -> list[float]:
        """Edges of the bands that can be picked."""
        marks = (m for p in self.picture.panels if p.role == "bands" for m in p.marks)
        return list(map(float, next(m for m in marks if isinstance(m, Steps)).edges))

    def _plot(self, panel: Panel) -> Plot:
        """Draw a panel."""
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
        if panel.level is not None:
            plot.add_layout(Span(dimension="width", location=panel.level, line_color=GREY))
        for mark in panel.marks:
            self._add(mark, plot)
        if panel.maps and self.picture.lines:
            self._pick_line(plot, panel.maps[0])
        self._tell(plot, panel)
        return plot

    def _add(self, mark: Mark, plot: Plot) -> None:
        source = source_of(mark)
        draw(mark, plot, source)
        if isinstance(mark, Map):
            self.images[id(mark)] = source
        if isinstance(mark, PickedLine):
            of = mark.of
            if id(of) not in self.images:
                self.images[id(of)] = source_of(of)
            ends: dict[str, Any] = {"bottom": of.bottom, "top": of.top}
            args = {"line": self.line, "source": source, "image": self.images[id(of)], **ends}
            self.line.js_on_change("location", CustomJS(args=args, code=PICK_LINE))

    def _shared(self, panel: Panel) -> dict[str, Any]:
        """Ranges that another panel has made, or those that this one shares with others."""
        own: dict[str, Any] = {"x_range": DataRange1d(range_padding=0.0)}
        for of in panel.maps:
            own["x_range"] = Range1d(start=of.left, end=of.right, bounds="auto")
            own["y_range"] = Range1d(start=of.bottom, end=of.top, bounds="auto")
        labels = {"x_range": panel.x, "y_range": panel.y}
        return {
            name: self.ranges.setdefault((name, labels[name]), made) for name, made in own.items()
        }

    def _pick_line(self, plot: Plot, of: Map) -> None:
        """Have a tap on an image pick its line, as the page's own control does."""
        self.line.update(name=f"line of {self.picture.name}", tags=[of.bottom, of.top])
        self.line.location = 0.5 * (of.bottom + of.top)
        plot.add_layout(self.line)
        plot.js_on_event(Tap, CustomJS(args={"line": self.line}, code="line.location = cb_obj.y"))

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
                plot.add_tools(
                    HoverTool(
                        renderers=[renderer],
                        mode="vline",
                        attachment=side,
                        tooltips=tips,
                        formatters=forms,
                        visible=False,
                    )
                )
        cursor = Span(dimension="height", line_color=DARK_GREY)
        cursor = self.cursors.setdefault(panel.x, cursor)
        unseen = Span(dimension="width", line_alpha=0.0)
        plot.add_tools(CrosshairTool(overlay=(cursor, unseen)))


def _scale(panel: Panel, axis: str) -> Literal["log", "linear"]:
    return "log" if axis in panel.log else "linear"
