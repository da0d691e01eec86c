"""Pictures of scans: desired, achieved, their errors, and a grating imaged by each of two."""

from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from numpy.typing import NDArray

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.image_lines import LineImager, frame_of
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import end, part
from afm_scan_ros.core.trajectory import TO_AND_FRO, SampleKinds, phases, sample_kinds
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.files.paths import replacing
from afm_scan_ros.report.analysis import DESIRED, scan_spec
from afm_scan_ros.report.style import (
    BLUE,
    GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    MILLI,
    NANO,
    ORANGE,
    blank,
    legend_above,
    styled,
    zero_line,
)
from afm_scan_ros.simulation.sample import Grating

WITHOUT, WITH = "without compensation", "with compensation"
SHOWN = 3
"""Lines in a picture, after the first."""


@frozen(eq=False)
class ScanExcerpt:
    """A few lines of a recorded scan: desired and achieved displacement (m), sample by sample.

    ``displacement`` is the kind of the achieved one: ``true``, without noise, or ``measured``.
    """

    spec: ScanSpec
    desired: Trace
    achieved: Trace
    displacement: str

    @property
    def kinds(self) -> SampleKinds:
        """What each sample is."""
        return sample_kinds(self.spec, self.desired.first_sample, self.desired.x.size)

    def error(self, axis: str) -> Array:
        """Achieved minus desired displacement, m."""
        return self.achieved.axis(axis) - self.desired.axis(axis)


def view_of(recording: ScanRecording) -> ScanExcerpt:
    """Read ``SHOWN`` lines after the first to-and-fro; all of them if there are fewer.

    The achieved displacement is the true one where the bag has it.
    Raises InputError as reading the recording does.
    """
    spec = scan_spec(recording)
    where = phases(spec).lines
    start = where.start + spec.samples_per_line
    stop = min(where.stop, start + SHOWN * spec.samples_per_line)
    true = "true_displacement" in recording.topics
    achieved = "true_displacement" if true else "achieved_displacement"
    runs = takewhile(lambda run: run[0].first_sample < stop, recording.blocks(DESIRED, achieved))
    found = [
        [part(trace, max(start, trace.first_sample), min(stop, end(trace))) for trace in run]
        for run in runs
        if end(run[0]) > start
    ]
    desired, shown = (_joined(start, spec, [run[i] for run in found]) for i in range(2))
    return ScanExcerpt(spec, desired, shown, "true" if true else "measured")


def _joined(start: int, spec: ScanSpec, runs: list[Trace]) -> Trace:
    x, y = (np.concatenate([np.empty(0), *(run.axis(axis) for run in runs)]) for axis in AXES)
    return Trace(start, spec.sample_period, x, y)


@styled
def tracking_figure(view: ScanExcerpt, title: str = "") -> Figure:
    """Show x, y and their error over a few lines, and the x error against position."""
    figure = blank(9.6, 6.0, title)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.6, 1.0))
    achieved = f"achieved ({view.displacement})"
    panels = _over_time(figure, columns[0], (view, BLUE, achieved))
    _shade(panels[1], view, view.kinds.turnaround, "turn-around")
    _shade(panels[3], view, view.kinds.y_step, "step in y")
    beside = figure.add_subplot(columns[1])
    if view.spec.pattern in TO_AND_FRO:
        _against_position(beside, view, (BLUE, ORANGE))
    else:
        _in_plane(beside, view, achieved)
    return figure


@styled
def comparison_figure(without: ScanExcerpt, compensated: ScanExcerpt, title: str = "") -> Figure:
    """Show the same lines without and with compensation: x, y, their errors, and x by position."""
    figure = blank(9.6, 7.2, title)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.6, 1.0))
    _over_time(figure, columns[0], (without, ORANGE, WITHOUT), (compensated, BLUE, WITH))
    halves = columns[1].subgridspec(2, 1)
    above, below = figure.add_subplot(halves[0]), figure.add_subplot(halves[1])
    _against_position(above, without, (ORANGE, LIGHT_ORANGE), WITHOUT)
    _against_position(below, compensated, (BLUE, LIGHT_BLUE), WITH)
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


def _over_time(
    figure: Figure, column: SubplotSpec, *lines: tuple[ScanExcerpt, str, str]
) -> list[Axes]:
    """Draw x, its error, y and its error of each excerpt, in its colour and by its name."""
    rows = column.subgridspec(4, 1)
    top = figure.add_subplot(rows[0])
    panels = [top, *(figure.add_subplot(rows[i], sharex=top) for i in (1, 2, 3))]
    first, *_ = lines[0]
    for row, axis in enumerate(AXES):
        path, error = panels[2 * row : 2 * row + 2]
        desired = MICRO * first.desired.axis(axis)
        path.plot(_time(first), desired, color=GREY, lw=3.0, label="desired")
        for view, colour, name in lines:
            path.plot(_time(view), MICRO * view.achieved.axis(axis), color=colour, label=name)
            error.plot(_time(view), NANO * view.error(axis), color=colour)
        path.set_ylabel(f"{axis} in µm")
        error.set_ylabel(f"{axis} error in nm")
        zero_line(error)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    panels[-1].set_xlabel("time in ms")
    figure.align_ylabels(panels)
    legend_above(top)
    return panels


def _time(view: ScanExcerpt) -> Array:
    """Milliseconds since the first sample shown."""
    return MILLI * view.spec.sample_period * np.arange(view.desired.x.size, dtype=np.float64)


def _shade(panel: Axes, view: ScanExcerpt, apart: NDArray[np.bool_], name: str) -> None:
    """Shade the samples that are no part of the constant-speed lines."""
    if apart.any():
        across = panel.get_xaxis_transform()
        shaded: Any = {"transform": across, "color": GREY, "alpha": 0.35, "lw": 0.0, "label": name}
        panel.fill_between(_time(view), 0.0, 1.0, where=apart.tolist(), **shaded)
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, fontsize=8)


def _against_position(
    panel: Axes, view: ScanExcerpt, colours: tuple[str, str], title: str = ""
) -> None:
    kinds, position, error = view.kinds, MICRO * view.desired.x, NANO * view.error("x")
    ways = {"trace": kinds.trace, "retrace": kinds.retrace}
    for (name, mask), colour in zip(ways.items(), colours, strict=True):
        if mask.any():
            breaks = np.flatnonzero(np.diff(kinds.line[mask])) + 1
            x, y = (np.insert(values[mask], breaks, np.nan) for values in (position, error))
            panel.plot(x, y, color=colour, label=f"{name}, {title}" if title else name)
    panel.set(xlabel="desired x in µm", ylabel="x error in nm")
    zero_line(panel)
    legend_above(panel, columns=1 if title else 2)


def _in_plane(panel: Axes, view: ScanExcerpt, achieved: str) -> None:
    for path, name, colour, width in (
        (view.desired, "desired", GREY, 3.0),
        (view.achieved, achieved, BLUE, 1.1),
    ):
        panel.plot(MICRO * path.x, MICRO * path.y, color=colour, lw=width, label=name)
    panel.set(xlabel="x in µm", ylabel="y in µm", aspect="equal")
    legend_above(panel)


GRATING = Grating(pitch=16e-6, angle=float(np.radians(25.0)))
PIXELS = 256


@frozen(eq=False)
class TwoScans:
    """Two scans of the same lines: the desired displacement and the achieved ones, m.

    ``names`` state how each was made, as "with compensation".
    """

    spec: ScanSpec
    desired: Trace
    achieved: tuple[Trace, Trace]
    names: tuple[str, str]


@frozen(eq=False)
class Images:
    """Heights (m) along the lines' traces, (lines, pixels): without error, and by each scan."""

    spec: ScanSpec
    ideal: Array
    imaged: tuple[Array, Array]
    names: tuple[str, str]

    @property
    def errors(self) -> tuple[float, float]:
        """Rms height error (m) of each image."""
        first, second = (float(np.sqrt(np.mean((i - self.ideal) ** 2))) for i in self.imaged)
        return first, second


def images_of(scans: TwoScans) -> Images:
    """Image a grating by two scans; heights are drawn at the desired positions.

    Raises InputError where the pattern has no lines.
    """
    first, second = (_image(scans.spec, scans.desired, path) for path in scans.achieved)
    ideal = _image(scans.spec, scans.desired, scans.desired)
    return Images(scans.spec, ideal, (first, second), scans.names)


@styled
def error_figure(scans: TwoScans) -> Figure:
    """Draw the error of both axes over a few lines, of both scans."""
    spec = scans.spec
    start = phases(spec).lines.start + spec.samples_per_line
    shown = slice(start, start + SHOWN * spec.samples_per_line)
    time = MILLI * spec.sample_period * np.arange(len(scans.desired.x[shown]))
    figure = blank(9.6, 4.4)
    for panel, axis in zip(figure.subplots(2, 1, sharex=True), AXES, strict=True):
        lines = zip(scans.achieved, (ORANGE, BLUE), (1.6, 0.7), scans.names, strict=True)
        for path, colour, width, name in lines:  # the thinner one shows where they coincide
            error = path.axis(axis) - scans.desired.axis(axis)
            panel.plot(time, NANO * error[shown], color=colour, lw=width, label=name)
        zero_line(panel)
        panel.set_ylabel(f"{axis} error in nm")
    figure.axes[0].legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    figure.axes[-1].set_xlabel("time in ms")
    return figure


@styled
def image_figure(images: Images) -> Figure:
    """Draw the grating as each scan images it, and the height error of either image."""
    figure = blank(9.6, 7.2)
    half_x, half_y = (0.5 * MICRO * size for size in (images.spec.range_x, images.spec.range_y))
    area: dict[str, Any] = {
        "origin": "lower",
        "extent": (-half_x, half_x, -half_y, half_y),
        "aspect": "auto",
    }
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    wrong = [NANO * (image - images.ideal) for image in images.imaged]
    largest = float(np.abs(wrong).max())
    for column, name in enumerate(images.names):
        height, error = panels[:, column]
        drawn = height.imshow(NANO * images.imaged[column], cmap="gray", **area)
        height.set_title(f"image {name}")
        shown = error.imshow(wrong[column], cmap="RdBu_r", vmin=-largest, vmax=largest, **area)
        error.set(title=f"height error {name}", xlabel="x in µm")
    for panel in panels[:, 0]:
        panel.set_ylabel("y in µm")
    figure.colorbar(drawn, ax=panels[0], label="height in nm", fraction=0.04)
    figure.colorbar(shown, ax=panels[1], label="height error in nm", fraction=0.04)
    return figure


def _image(spec: ScanSpec, desired: Trace, path: Trace) -> Array:
    where = phases(spec).lines
    lines = slice(where.start, where.stop)
    heights = GRATING.height(path.x[lines], path.y[lines])
    frame = frame_of(spec, min(PIXELS, spec.samples_per_line // 2 - 1))
    made = LineImager(spec, frame).add(desired.x[lines], heights)
    return np.stack([line.trace for line in made])
