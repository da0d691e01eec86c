"""Pictures of scans: desired, achieved, their errors, and a grating imaged by each of two."""

from collections.abc import Sequence
from itertools import takewhile

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.image_lines import LineImager, frame_of, most_pixels
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import DESIRED, DRIVE, within
from afm_scan_ros.core.trajectory import TO_AND_FRO, SampleKinds, phases, sample_kinds
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.analysis import scan_spec
from afm_scan_ros.report.picture import (
    BLUE,
    GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    MILLI,
    NANO,
    ORANGE,
    Curve,
    Map,
    Mark,
    Panel,
    PickedLine,
    Picture,
    Stretches,
    image_row,
    picked_lines,
)
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.sentences import sentence
from afm_scan_ros.simulation.sample import Grating

WITHOUT, WITH = "without compensation", "with compensation"
SHOWN = 3
"""Lines in a picture, after the first."""
TIME = "time in ms"
WAYS = "trace", "retrace"
LOW = 0.75
"""Height of a row where several stand above one another."""


@frozen(eq=False)
class ScanExcerpt:
    """A few lines of a recorded scan: desired and achieved displacement (m), sample by sample.

    ``displacement`` is the kind of the achieved one: ``true``, without noise, or ``measured``.
    ``drive`` (V) is None where it was not recorded.
    """

    spec: ScanSpec
    desired: Trace
    achieved: Trace
    displacement: str
    drive: Trace | None

    @property
    def kinds(self) -> SampleKinds:
        """What each sample is."""
        return sample_kinds(self.spec, self.desired.first_sample, self.desired.x.size)

    @property
    def milliseconds(self) -> Array:
        """Time since the first sample shown."""
        count = self.desired.x.size
        return MILLI * self.spec.sample_period * np.arange(count, dtype=np.float64)

    def error(self, axis: str) -> Array:
        """Achieved minus desired displacement, m."""
        return self.achieved.axis(axis) - self.desired.axis(axis)


def topics_shown(recording: ScanRecording) -> tuple[str, ...]:
    """Topics of desired and achieved displacement and, where it is recorded, of the drive.

    The achieved displacement is the true one where the bag has it.
    """
    true = "true_displacement" in recording.topics
    achieved = "true_displacement" if true else "achieved_displacement"
    return (DESIRED, achieved, *([DRIVE] if DRIVE in recording.topics else []))


def view_of(recording: ScanRecording) -> ScanExcerpt:
    """Read ``SHOWN`` lines after the first to-and-fro; all of them if there are fewer.

    Raises InputError as reading the recording does.
    """
    spec, topics = scan_spec(recording), topics_shown(recording)
    where = phases(spec).lines
    shown = where[spec.samples_per_line :][: SHOWN * spec.samples_per_line]
    runs = takewhile(lambda run: run[0].first_sample < shown.stop, recording.blocks(*topics))
    nothing = Trace(shown.start, spec.sample_period, np.empty(0), np.empty(0))
    found = [[nothing] * len(topics), *filter(None, (within(shown, run) for run in runs))]
    desired, achieved, *drive = (_joined(traces) for traces in zip(*found, strict=True))
    kind = topics[1].partition("_")[0].replace("achieved", "measured")
    return ScanExcerpt(spec, desired, achieved, kind, drive[0] if drive else None)


def _joined(runs: Sequence[Trace]) -> Trace:
    x, y = (np.concatenate([run.axis(axis) for run in runs]) for axis in AXES)
    return Trace(runs[0].first_sample, runs[0].sample_period, x, y)


def tracking_picture(view: ScanExcerpt, title: str = "") -> Picture:
    """Show x, y, their errors and the drive over a few lines, and the x error by position."""
    achieved = f"achieved ({view.displacement})"
    apart = {
        "x": Stretches(_stretches(view, view.kinds.turnaround), "turn-around"),
        "y": Stretches(_stretches(view, view.kinds.y_step), "step in y"),
    }
    rows = _over_time([(view, BLUE, achieved)], apart)
    beside = (
        _against_position(view, (BLUE, ORANGE))
        if view.spec.pattern in TO_AND_FRO
        else _in_plane(view, achieved)
    )
    driven = [_drive(view, view.drive)] if view.drive else []
    caption = sentence("caption.tracking", count=SHOWN, achieved=achieved)
    return Picture("lines", caption, (*rows, (*driven, beside)), LOW, title=title)


def comparison_picture(
    name: str, without: ScanExcerpt, compensated: ScanExcerpt, title: str = ""
) -> Picture:
    """Show the same lines without and with compensation: x, y, their errors, drives, positions."""
    pair = [(without, ORANGE, WITHOUT), (compensated, BLUE, WITH)]
    beside = [
        _against_position(without, (ORANGE, LIGHT_ORANGE), WITHOUT),
        _against_position(compensated, (BLUE, LIGHT_BLUE), WITH),
    ]
    caption = sentence("caption.compared", count=SHOWN, without=WITHOUT, compensated=WITH)
    return Picture(name, caption, (*_over_time(pair, {}), beside), LOW, title=title)


def _over_time(
    views: Sequence[tuple[ScanExcerpt, str, str]], apart: dict[str, Stretches]
) -> list[list[Panel]]:
    """Return a row of x and y, and one of their errors, of each excerpt in its colour."""
    first, *_ = views[0]
    paths, errors = [], []
    for axis in AXES:
        desired = Curve(first.milliseconds, MICRO * first.desired.axis(axis), "desired", GREY, 3.0)
        moved = [
            Curve(view.milliseconds, MICRO * view.achieved.axis(axis), name, colour)
            for view, colour, name in views
        ]
        wrong: list[Mark] = [
            Curve(view.milliseconds, NANO * view.error(axis), "", colour)
            for view, colour, _ in views
        ]
        wrong += [apart[axis]] if axis in apart else []
        paths.append(Panel([desired, *moved], TIME, f"{axis} in µm"))
        errors.append(Panel(wrong, TIME, f"{axis} error in nm", level=0.0))
    return [paths, errors]


def _drive(view: ScanExcerpt, drive: Trace) -> Panel:
    curves = [
        Curve(view.milliseconds, drive.axis(axis), axis, colour)
        for axis, colour in zip(AXES, (BLUE, ORANGE), strict=True)
    ]
    return Panel(curves, TIME, "drive in V")


def _stretches(view: ScanExcerpt, apart: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return from when to when samples are set apart, ms."""
    edges = np.flatnonzero(np.diff(apart.astype(int), prepend=0, append=0))
    time = np.append(view.milliseconds, view.milliseconds[-1:])
    return [(float(time[a]), float(time[b])) for a, b in edges.reshape(-1, 2)]


def _against_position(view: ScanExcerpt, colours: tuple[str, str], title: str = "") -> Panel:
    kinds, position, error = view.kinds, MICRO * view.desired.x, NANO * view.error("x")
    curves = []
    for way, colour in zip(WAYS, colours, strict=True):
        if (mask := getattr(kinds, way)).any():
            breaks = np.flatnonzero(np.diff(kinds.line[mask])) + 1
            x, y = (np.insert(values[mask], breaks, np.nan) for values in (position, error))
            curves.append(Curve(x, y, f"{way}, {title}" if title else way, colour))
    return Panel(curves, "desired x in µm", "x error in nm", level=0.0)


def _in_plane(view: ScanExcerpt, achieved: str) -> Panel:
    wanted, moved = view.desired, view.achieved
    desired = Curve(MICRO * wanted.x, MICRO * wanted.y, "desired", GREY, 3.0)
    shown = Curve(MICRO * moved.x, MICRO * moved.y, achieved)
    return Panel([desired, shown], "x in µm", "y in µm", equal=True)


GRATING = Grating(pitch=16e-6, angle=float(np.radians(25.0)))
PIXELS = 256


@frozen(eq=False)
class TwoScans:
    """Two scans of the same lines: the desired displacement and the achieved ones, m.

    ``displacement`` is the kind of the achieved ones: ``true`` or ``measured``. ``names`` state how
    each was made, as "with compensation".
    """

    spec: ScanSpec
    desired: Trace
    achieved: tuple[Trace, Trace]
    displacement: str
    names: tuple[str, str]

    @classmethod
    def of(cls, before: Scan, after: Scan, *names: str) -> "TwoScans":
        """Return the true displacements where both are known, or else the measured ones."""
        kind = "true" if before.knows_true and after.knows_true else "measured"
        achieved = getattr(before, kind), getattr(after, kind)
        first, second = names
        return cls(before.spec, before.desired, achieved, kind, (first, second))


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


def error_picture(name: str, scans: TwoScans) -> Picture:
    """Show the error of both axes over a few lines, of both scans."""
    spec = scans.spec
    start = phases(spec).lines.start + spec.samples_per_line
    shown = slice(start, start + SHOWN * spec.samples_per_line)
    time = MILLI * spec.sample_period * np.arange(len(scans.desired.x[shown]), dtype=np.float64)
    panels = []
    for axis in AXES:
        curves = [
            Curve(time, NANO * (path.axis(axis) - scans.desired.axis(axis))[shown], name, colour, w)
            for path, colour, w, name in zip(
                scans.achieved, (ORANGE, BLUE), (1.8, 1.0), scans.names, strict=True
            )
        ]
        panels.append([Panel(curves, TIME, f"{axis} error in nm", level=0.0)])
    kind = scans.displacement.capitalize()
    return Picture(name, sentence("caption.errors", kind=kind, count=SHOWN), panels)


def image_picture(name: str, images: Images, how: str) -> Picture:
    """Show the grating as each scan images it, the height error of either, and a line of them.

    ``how`` says how it was scanned, as "at 30 Hz with 64 lines".
    """
    spec = images.spec
    centred = (MICRO * np.array(spec.extent(axis)) for axis in AXES)
    (left, right), (low, high) = ((at - 0.5 * wide, at + 0.5 * wide) for at, wide in centred)
    span = float(left), float(right), float(low), float(high)
    wrong = [NANO * (image - images.ideal) for image in images.imaged]
    ends = float(NANO * images.ideal.min()), float(NANO * images.ideal.max())
    largest = float(np.abs(wrong).max())
    x, y, height, error = "x in µm", "y in µm", "height in nm", "height error in nm"
    ideal, *imaged = [Map(NANO * v, span, height, *ends) for v in (images.ideal, *images.imaged)]
    off = [Map(v, span, error, -largest, largest, signed=True) for v in wrong]
    line = picked_lines(imaged, images.names, (ORANGE, BLUE))
    missed = picked_lines(off, ("", ""), (ORANGE, BLUE))
    rows = (
        image_row(imaged, [f"image {name}" for name in images.names], x, y),
        [
            Panel([PickedLine(ideal, "without error", GREY), *line], x, height),
            Panel(missed, x, error, level=0.0),
        ],
        image_row(off, [f"height error {name}" for name in images.names], x, y),
    )
    pairs = zip(images.errors, images.names, strict=True)
    errors = [f"{nanometres(error)} nm rms {name}" for error, name in pairs]
    caption = sentence("caption.image", how=how, errors=errors)
    return Picture(name, caption, rows)


def _image(spec: ScanSpec, desired: Trace, path: Trace) -> Array:
    where = phases(spec).lines
    lines = slice(where.start, where.stop)
    heights = GRATING.height(path.x[lines], path.y[lines])
    frame = frame_of(spec, min(PIXELS, most_pixels(spec)))
    made = LineImager(spec, frame).add(desired.x[lines], heights)
    return np.stack([line.trace for line in made])
