"""Pictures of a scan: desired, achieved, and the error between them."""

from pathlib import Path

import numpy as np
from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.align import end, part
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import SampleKinds, phases, sample_kinds
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.analysis import scan_spec
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE, STYLE, styled

MICRO = 1e6
NANO = 1e9
MILLI = 1e3
WITHOUT, WITH = "without compensation", "with compensation"


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


def view_of(recording: ScanRecording, lines: int = 3) -> ScanExcerpt:
    """Read ``lines`` lines after the first to-and-fro; all of them if there are fewer.

    The achieved displacement is the true one where the bag has it.
    Raises InputError as reading the recording does.
    """
    spec = scan_spec(recording)
    where = phases(spec).lines
    start = where.start + spec.samples_per_line
    stop = min(where.stop, start + lines * spec.samples_per_line)
    true = "true_displacement" in recording.topics
    achieved = "true_displacement" if true else "achieved_displacement"
    found: list[tuple[Trace, ...]] = []
    for by_axis in recording.blocks("desired_displacement", achieved):
        if by_axis[0].first_sample >= stop:
            break
        if end(by_axis[0]) > start:
            first, last = max(start, by_axis[0].first_sample), min(stop, end(by_axis[0]))
            found.append(tuple(part(trace, first, last) for trace in by_axis))
    desired, shown = (_joined(start, spec, [f[i] for f in found]) for i in range(2))
    return ScanExcerpt(spec, desired, shown, "true" if true else "measured")


def _joined(start: int, spec: ScanSpec, by_axis: list[Trace]) -> Trace:
    x = np.concatenate([np.empty(0), *(trace.x for trace in by_axis)])
    y = np.concatenate([np.empty(0), *(trace.y for trace in by_axis)])
    return Trace(start, spec.sample_period, x, y)


@styled
def tracking_figure(view: ScanExcerpt, title: str = "") -> Figure:
    """Show x, y and their error over a few lines, and the x error against position."""
    figure = _figure(9.6, 6.0, title)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.6, 1.0))
    panels = _stacked(figure, columns[0])
    for row, axis in enumerate(AXES):
        _paths(panels[2 * row], view, axis)
        _error(panels[2 * row + 1], view, axis)
    _legend_above(panels[0])
    beside = figure.add_subplot(columns[1])
    if view.spec.pattern in TO_AND_FRO:
        _against_position(beside, view, BLUE, ORANGE)
    else:
        _in_plane(beside, view)
    return figure


@styled
def comparison_figure(without: ScanExcerpt, compensated: ScanExcerpt, title: str = "") -> Figure:
    """Show the same lines without and with compensation: x, y, their errors, and x by position."""
    figure = _figure(9.6, 7.2, title)
    columns = figure.add_gridspec(1, 2, width_ratios=(1.6, 1.0))
    panels = _stacked(figure, columns[0])
    for row, axis in enumerate(AXES):
        path, error = panels[2 * row : 2 * row + 2]
        path.plot(_time(without), MICRO * without.desired.axis(axis), color=GREY, lw=3.0)
        for view, colour in ((without, ORANGE), (compensated, BLUE)):
            path.plot(_time(view), MICRO * view.achieved.axis(axis), color=colour)
            error.plot(_time(view), NANO * view.error(axis), color=colour)
        path.set_ylabel(f"{axis} in µm")
        error.set_ylabel(f"{axis} error in nm")
        _zero(error)
    for line, name in zip(panels[0].get_lines(), ("desired", WITHOUT, WITH), strict=True):
        line.set_label(name)
    _legend_above(panels[0])
    halves = columns[1].subgridspec(2, 1)
    above, below = figure.add_subplot(halves[0]), figure.add_subplot(halves[1])
    _against_position(above, without, ORANGE, LIGHT_ORANGE, WITHOUT)
    _against_position(below, compensated, BLUE, LIGHT_BLUE, WITH)
    return figure


@styled
def save(figure: Figure, path: Path) -> None:
    """Write a figure to a file whose suffix gives the format, as ``.png`` or ``.svg``.

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


def _stacked(figure: Figure, column: SubplotSpec) -> list[Axes]:
    """Return four panels in a column of a figure, with one time axis below them."""
    rows = column.subgridspec(4, 1)
    top = figure.add_subplot(rows[0])
    panels = [top, *(figure.add_subplot(rows[i], sharex=top) for i in (1, 2, 3))]
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    panels[-1].set_xlabel("time in ms")
    figure.align_ylabels(panels)
    return panels


def _time(view: ScanExcerpt) -> Array:
    """Milliseconds since the first sample shown."""
    return np.linspace(
        0.0,
        view.desired.x.size * view.spec.sample_period * MILLI,
        view.desired.x.size,
        endpoint=False,
    )


def _paths(panel: Axes, view: ScanExcerpt, axis: str) -> None:
    time = _time(view)
    panel.plot(time, MICRO * view.desired.axis(axis), color=GREY, lw=3.0, label="desired")
    achieved = f"achieved ({view.displacement})"
    panel.plot(time, MICRO * view.achieved.axis(axis), color=BLUE, label=achieved)
    panel.set_ylabel(f"{axis} in µm")


def _error(panel: Axes, view: ScanExcerpt, axis: str) -> None:
    time, kinds = _time(view), view.kinds
    panel.plot(time, NANO * view.error(axis), color=BLUE)
    panel.set_ylabel(f"{axis} error in nm")
    _zero(panel)
    apart, name = (kinds.turnaround, "turn-around") if axis == "x" else (kinds.y_step, "step in y")
    panel.fill_between(
        time,
        0.0,
        1.0,
        where=apart.tolist(),
        transform=panel.get_xaxis_transform(),
        color=GREY,
        alpha=0.35,
        lw=0.0,
        label=name,
    )
    if apart.any():
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0, fontsize=8)


def _against_position(
    panel: Axes, view: ScanExcerpt, trace: str, retrace: str, title: str = ""
) -> None:
    kinds, position, error = view.kinds, MICRO * view.desired.x, NANO * view.error("x")
    for mask, colour, name in ((kinds.trace, trace, "trace"), (kinds.retrace, retrace, "retrace")):
        if mask.any():
            breaks = np.flatnonzero(np.diff(kinds.line[mask])) + 1
            x, y = (np.insert(values[mask], breaks, np.nan) for values in (position, error))
            panel.plot(x, y, color=colour, label=f"{name}, {title}" if title else name)
    panel.set(xlabel="desired x in µm", ylabel="x error in nm")
    _zero(panel)
    _legend_above(panel, columns=1 if title else 2)


def _in_plane(panel: Axes, view: ScanExcerpt) -> None:
    for trace, name, colour, width in (
        (view.desired, "desired", GREY, 3.0),
        (view.achieved, f"achieved ({view.displacement})", BLUE, 1.1),
    ):
        panel.plot(MICRO * trace.x, MICRO * trace.y, color=colour, lw=width, label=name)
    _legend_above(panel)
    panel.set(xlabel="x in µm", ylabel="y in µm", aspect="equal")


def _zero(panel: Axes) -> None:
    panel.axhline(0.0, color=STYLE["axes.edgecolor"], lw=0.6, zorder=0)


def _legend_above(panel: Axes, columns: int = 3) -> None:
    if panel.get_legend_handles_labels()[0]:  # a bag cut short may hold no line yet
        panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2)
