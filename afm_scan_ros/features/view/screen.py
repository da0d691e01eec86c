"""What a viewer shows of one scan: curves, errors by line, images, states and news."""

import time
from collections.abc import Mapping
from math import inf
from typing import TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from attrs import define, evolve, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE, LineError
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.features.view.viewer import LOOPBACK, WINDOW, ViewSettings, ports
from afm_scan_ros.files.units import UNITS

ERROR = "error"
SCAN_TIME, WALL_CLOCK = "scan_time", "wall_clock"
"""Timelines: time in the scan, and the moment at which the viewer was given a value."""


@frozen
class ScreenPanel:
    """A panel of curves: its folder, its title, its unit and the colour of each curve."""

    folder: str
    name: str
    unit: str
    curves: Mapping[str, str]

    @property
    def title(self) -> str:
        """Title with the unit."""
        return f"{self.name}, {self.unit.replace('um', 'µm')}"


DARK, LIGHT = ("#0b5fa5", "#c4501b"), ("#86b6de", "#eaa987")
"""Blue for x, orange for y, as in the figures of reports, whose module is slow to import."""
OF_LINES = {
    f"{kind}_{axis}": colour
    for kind, colours in (("rms", DARK), ("max", LIGHT))
    for axis, colour in zip(AXES, colours, strict=True)
}
OF_AXES, FAINT = (dict(zip(AXES, colours, strict=True)) for colours in (DARK, LIGHT))
PANELS = {
    DESIRED: ScreenPanel("displacement/desired", "Displacement", "um", FAINT),
    ACHIEVED: ScreenPanel("displacement/achieved", "Displacement", "um", OF_AXES),
    ERROR: ScreenPanel("error", "Error (achieved - desired)", "nm", OF_AXES),
    DRIVE: ScreenPanel("drive", "Drive", "V", OF_AXES),
    "tracking_error": ScreenPanel("lines/error", "Error of each line", "nm", OF_LINES),
    "model_residual": ScreenPanel("lines/residual", "Residual of each line", "nm", OF_LINES),
}
Whole: TypeAlias = NDArray[np.int64]
Rows: TypeAlias = tuple[Whole, Array]


@define(eq=False)
class Screen:
    """One scan in the viewer that ``stream`` leads to.

    What is shown is gathered, and goes out with ``refresh``, which waits for a viewer that is slow.
    """

    info: ScanInfo
    stream: rr.RecordingStream
    settings: ViewSettings = field(factory=ViewSettings)
    _rows: dict[str, list[Rows]] = field(factory=dict, init=False)
    _images: dict[str, Array] = field(factory=dict, init=False)
    _states: dict[str, str] = field(factory=dict, init=False)
    _stills_at: float = field(default=0.0, init=False)

    def __attrs_post_init__(self) -> None:
        rr.send_blueprint(layout(self.info), recording=self.stream)
        for panel in PANELS.values():
            for name, colour in panel.curves.items():
                title = f"{panel.folder.rpartition('/')[2]} {name.replace('_', ' ')}"
                rgb = [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
                style = rr.SeriesLine(color=rgb, name=title)
                rr.log(f"{panel.folder}/{name}", style, static=True, recording=self.stream)

    def curve(self, name: str, samples: Whole, x: Array, y: Array) -> None:
        """Show values (m or V) at numbers of samples of a curve."""
        for axis, values in zip(AXES, (x, y), strict=True):
            self._add(PANELS[name], axis, samples, values)

    def line(self, name: str, figures: LineError) -> None:
        """Show the figures (m) of one line, of ``tracking_error`` or ``model_residual``."""
        samples = np.array([figures.first_sample])
        for each in OF_LINES:
            self._add(PANELS[name], each, samples, np.array([getattr(figures, each)]))

    def image(self, name: str, values: Array) -> None:
        """Show an image (m) as far as it is known; what is not is not a number."""
        self._images[name] = values / UNITS["nm"]

    def state(self, node: str, state: str, sample: int, reason: str) -> None:
        """Show the state of a node, or of the scan."""
        share = sample / self.info.total_samples
        cells = (node, state, f"{sample} ({share:.0%})", reason.replace("|", "\\|"))
        self._states[node] = f"| {' | '.join(cells)} |"

    def say(self, text: str, sample: int, level: str = "WARN") -> None:
        """Show news of a sample's time."""
        rr.set_time_seconds(SCAN_TIME, sample * self.info.sample_period, recording=self.stream)
        rr.log("news", rr.TextLog(text, level=level), recording=self.stream)

    def refresh(self, *, last: bool = False) -> None:
        """Give the viewer what has been gathered; images and states where it is time."""
        now = time.time()
        for path, rows in self._rows.items():
            samples, values = (np.concatenate(part) for part in zip(*rows, strict=True))
            rr.send_columns(
                path,
                indexes=[
                    rr.TimeSecondsColumn(SCAN_TIME, samples * self.info.sample_period),
                    rr.TimeSecondsColumn(WALL_CLOCK, np.full(samples.size, now)),
                ],
                columns=rr.Scalar.columns(scalar=values),
                recording=self.stream,
            )
        self._rows.clear()
        if last or now - self._stills_at >= self.settings.image_interval:
            self._stills_at = now
            self._show_stills()
        self.stream.flush(blocking=True)

    def _add(self, panel: ScreenPanel, name: str, samples: Whole, values: Array) -> None:
        rows = self._rows.setdefault(f"{panel.folder}/{name}", [])
        rows.append((samples, values / UNITS[panel.unit]))

    def _show_stills(self) -> None:
        """Show images and states, of which the viewer keeps the last ones alone."""
        for name, values in self._images.items():
            above = values - np.nanmin(values, initial=np.inf)  # colours begin at 0
            heights = np.nan_to_num(above, nan=0.0).astype(np.float32)
            shown = rr.DepthImage(heights, colormap=rr.components.Colormap.Viridis)
            rr.log(f"image/{name}", shown, static=True, recording=self.stream)
        self._images.clear()
        if self._states:
            head = "| part | state | sample | reason |\n| --- | --- | --- | --- |"
            table = "\n".join([head, *self._states.values()])
            shown_table = rr.TextDocument(table, media_type=rr.MediaType.MARKDOWN)
            rr.log("states", shown_table, static=True, recording=self.stream)


def layout(info: ScanInfo) -> rrb.Blueprint:
    """Return where the viewer shows what: curves on the left, all else on the right."""
    views = {}
    for panel in PANELS.values():
        top = panel.folder.partition("/")[0]
        folder = panel.folder if top == "lines" else top
        views[folder] = rrb.TimeSeriesView(origin="/", contents=[f"/{folder}/**"], name=panel.title)
    lines = [views.pop(folder) for folder in list(views) if folder.startswith("lines")]
    image = [rrb.Spatial2DView(origin="/image", name="Image")] if info.spec is not None else []
    said = rrb.Horizontal(
        rrb.TextDocumentView(origin="/states", name="States"),
        rrb.TextLogView(origin="/news", name="News"),
    )
    right = rrb.Vertical(*image, rrb.Tabs(*lines), said)
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(*views.values()), right, column_shares=[3, 2]),
        collapse_panels=True,
    )


def open_screen(info: ScanInfo, where: str, settings: ViewSettings) -> Screen:
    """Return the screen of a scan in the viewer that is open, or in a file."""
    stream = rr.new_recording("afm_scan", recording_id=info.scan_id)
    if where == WINDOW:
        address = f"{LOOPBACK}:{ports().scans}"
        rr.connect_tcp(address, flush_timeout_sec=settings.giving_up, recording=stream)
    else:
        rr.save(where, recording=stream)
        settings = evolve(settings, image_interval=inf)
    return Screen(info, stream, settings)
