"""Pictures of a scan: desired, achieved, and the error between them."""

from pathlib import Path

import numpy as np
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.bag.reader import Recording
from afm_scan_ros.core.align import end, part
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import SampleKinds, phases, sample_kinds
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.report.analysis import scan_spec
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE, STYLE, styled

MICRO = 1e6
NANO = 1e9
MILLI = 1e3


@frozen(eq=False)
class ScanExcerpt:
    """The same samples of the desired and the achieved displacement, m."""

    spec: ScanSpec
    desired: Trace
    achieved: Trace

    @property
    def kinds(self) -> SampleKinds:
        """What each sample is."""
        return sample_kinds(self.spec, self.desired.first_sample, self.desired.x.size)


def view_of(recording: Recording, lines: int = 3) -> ScanExcerpt:
    """Read ``lines`` lines after the first to-and-fro; all of them if there are fewer.

    Of a simulated scan it is the true displacement, free of noise, as far as the bag has it.
    Raises InputError as reading the recording does.
    """
    spec = scan_spec(recording)
    where = phases(spec).lines
    start = where.start + spec.samples_per_line
    stop = min(where.stop, start + lines * spec.samples_per_line)
    true = "true_displacement" in recording.topics
    achieved = "true_displacement" if true else "achieved_displacement"
    found: list[tuple[Trace, ...]] = []
    for traces in recording.blocks("desired_displacement", achieved):
        if traces[0].first_sample >= stop:
            break
        if end(traces[0]) > start:
            first, last = max(start, traces[0].first_sample), min(stop, end(traces[0]))
            found.append(tuple(part(trace, first, last) for trace in traces))
    return ScanExcerpt(spec, *(_joined(start, spec, [f[i] for f in found]) for i in range(2)))


def _joined(start: int, spec: ScanSpec, traces: list[Trace]) -> Trace:
    x = np.concatenate([np.empty(0), *(trace.x for trace in traces)])
    y = np.concatenate([np.empty(0), *(trace.y for trace in traces)])
    return Trace(start, spec.sample_period, x, y)


@styled
def tracking_figure(view: ScanExcerpt, title: str = "") -> Figure:
    """Show x, y and their error over a few lines, and the x error against position."""
    figure = _figure(9.6, 6.0, title)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.6, 1.0), height_ratios=(1.3, 1.0, 1.0, 1.0))
    time = _time(view)
    top = figure.add_subplot(grid[0, 0])
    panels = [top, *(figure.add_subplot(grid[row, 0], sharex=top) for row in (1, 2, 3))]
    _paths(panels[0], time, view, "x")
    _error(panels[1], time, view, "x")
    _paths(panels[2], time, view, "y")
    _error(panels[3], time, view, "y")
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    panels[-1].set_xlabel("time in ms")
    figure.align_ylabels(panels)
    beside = figure.add_subplot(grid[:, 1])
    if view.spec.pattern in TO_AND_FRO:
        _against_position(beside, view, BLUE, ORANGE)
    else:
        _in_plane(beside, view)
    return figure


@styled
def comparison_figure(without: ScanExcerpt, compensated: ScanExcerpt, title: str = "") -> Figure:
    """Show the same lines without and with compensation: the paths, and both errors."""
    figure = _figure(9.6, 6.0, title)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.6, 1.0))
    time = _time(without)
    paths = figure.add_subplot(grid[0, 0])
    paths.plot(time, MICRO * without.desired.x, color=GREY, lw=3.0, label="desired")
    paths.plot(time, MICRO * without.achieved.x, color=ORANGE, label="without compensation")
    paths.plot(_time(compensated), MICRO * compensated.achieved.x, color=BLUE, label="with")
    paths.set_ylabel("x in µm")
    _legend_above(paths)
    error = figure.add_subplot(grid[1, 0], sharex=paths)
    error.plot(time, MICRO * _of(without, "x"), color=ORANGE)
    error.plot(_time(compensated), MICRO * _of(compensated, "x"), color=BLUE)
    error.set(xlabel="time in ms", ylabel="x error in µm")
    _zero(error)
    above, below = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    _against_position(above, without, ORANGE, LIGHT_ORANGE)
    _against_position(below, compensated, BLUE, LIGHT_BLUE)
    above.set(xlabel="", ylabel="x error without, in nm")
    below.set_ylabel("x error with, in nm")
    return figure


@styled
def save(figure: Figure, path: Path) -> None:
    """Write a figure to a file whose ending says the format, as ``.png`` or ``.svg``.

    Raises InputError for an ending that is none of a picture.
    """
    known = figure.canvas.get_supported_filetypes()
    if path.suffix.removeprefix(".") not in known:
        raise InputError(f"{path}: unknown kind of picture: end it in .png, .svg or .pdf")
    figure.savefig(path, dpi=160)


def _figure(width: float, height: float, title: str) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    if title:
        figure.suptitle(title, x=0.01, ha="left")
    return figure


def _time(view: ScanExcerpt) -> Array:
    """Milliseconds since the first sample shown."""
    return np.linspace(
        0.0,
        view.desired.x.size * view.spec.sample_period * MILLI,
        view.desired.x.size,
        endpoint=False,
    )


def _of(view: ScanExcerpt, axis: str) -> Array:
    return view.achieved.axis(axis) - view.desired.axis(axis)


def _paths(panel: Axes, time: Array, view: ScanExcerpt, axis: str) -> None:
    panel.plot(time, MICRO * view.desired.axis(axis), color=GREY, lw=3.0, label="desired")
    panel.plot(time, MICRO * view.achieved.axis(axis), color=BLUE, label="achieved")
    panel.set_ylabel(f"{axis} in µm")
    if axis == "x":
        _legend_above(panel)


def _error(panel: Axes, time: Array, view: ScanExcerpt, axis: str) -> None:
    panel.plot(time, NANO * _of(view, axis), color=BLUE)
    panel.set_ylabel(f"{axis} error in nm")
    _zero(panel)
    kinds = view.kinds
    turning = kinds.turnaround if axis == "x" else kinds.y_step
    panel.fill_between(
        time,
        0.0,
        1.0,
        where=turning.tolist(),
        transform=panel.get_xaxis_transform(),
        color=GREY,
        alpha=0.35,
        lw=0.0,
    )


def _against_position(panel: Axes, view: ScanExcerpt, trace: str, retrace: str) -> None:
    kinds, position, error = view.kinds, MICRO * view.desired.x, NANO * _of(view, "x")
    for mask, colour, name in ((kinds.trace, trace, "trace"), (kinds.retrace, retrace, "retrace")):
        if mask.any():
            breaks = np.flatnonzero(np.diff(kinds.line[mask])) + 1
            x, y = (np.insert(values[mask], breaks, np.nan) for values in (position, error))
            panel.plot(x, y, color=colour, label=name)
    panel.set(xlabel="desired x in µm", ylabel="x error in nm")
    _zero(panel)
    _legend_above(panel)


def _in_plane(panel: Axes, view: ScanExcerpt) -> None:
    for trace, colour, width in ((view.desired, GREY, 3.0), (view.achieved, BLUE, 1.1)):
        panel.plot(MICRO * trace.x, MICRO * trace.y, color=colour, lw=width)
    panel.set(xlabel="x in µm", ylabel="y in µm", aspect="equal")


def _zero(panel: Axes) -> None:
    panel.axhline(0.0, color=STYLE["axes.edgecolor"], lw=0.6, zorder=0)


def _legend_above(panel: Axes) -> None:
    if panel.get_legend_handles_labels()[0]:  # a bag cut short may hold no line yet
        panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
