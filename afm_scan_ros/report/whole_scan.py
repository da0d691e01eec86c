"""Pictures of a whole scan, read block by block: each signal's peaks, and the error by line."""

from collections import defaultdict
from collections.abc import Iterator
from math import ceil

import numpy as np
from attrs import define, field

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.image_lines import Frame, ImageLine, LineImager, frame_of, most_pixels
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import within
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.analysis import scan_spec
from afm_scan_ros.report.picture import (
    BLUE,
    MICRO,
    NANO,
    ORANGE,
    Curve,
    Map,
    Panel,
    Picture,
    image_row,
    picked_lines,
)
from afm_scan_ros.report.reduction import DRAWING, extremes, thinned
from afm_scan_ros.report.scan_pictures import LOW, WAYS, topics_shown
from afm_scan_ros.report.sentences import sentence

TIME = "time in s"


@define(eq=False)
class _Signal:
    """A signal of a scan, of which each block gives its extremes."""

    period: float
    share: float
    times: list[Array] = field(factory=list)
    values: list[Array] = field(factory=list)

    def add(self, first: int, values: Array) -> None:
        kept = extremes(values, ceil(self.share * values.size))
        self.times.append(self.period * (first + kept.astype(np.float64)))
        self.values.append(values[kept])

    def curve(self, scale: float, name: str, colour: str) -> Curve:
        time, values = np.concatenate(self.times), np.concatenate(self.values)
        return thinned(Curve(time, scale * values, name, colour))


Signals = dict[tuple[str, str], _Signal]
"""Each by what it is and its axis."""


def whole_pictures(recording: ScanRecording) -> Iterator[Picture]:
    """Yield the course of errors and drive over the whole scan, and the error by line and place.

    Keeps a block, a line and what is drawn in memory.
    """
    spec, topics = scan_spec(recording), topics_shown(recording)
    share = DRAWING.stretches / max(1, recording.info.total_samples)
    signals: Signals = defaultdict(lambda: _Signal(spec.sample_period, share))
    pixels = min(DRAWING.error_pixels, most_pixels(spec)) if spec.pattern in TO_AND_FRO else 0
    imager = _ErrorImager(spec, frame_of(spec, pixels)) if pixels > 0 else None
    for desired, achieved, *drive in recording.blocks(*topics):
        for axis in AXES:
            error = achieved.axis(axis) - desired.axis(axis)
            signals["error", axis].add(desired.first_sample, error)
            if drive:
                signals["drive", axis].add(desired.first_sample, drive[0].axis(axis))
        if imager is not None:
            imager.add(desired, achieved)
    if signals:
        yield _course(signals)
    if imager is not None and imager.lines["x"]:
        yield imager.picture()


def _course(signals: Signals) -> Picture:
    rows = [
        [Panel([signals["error", a].curve(NANO, "", BLUE)], TIME, f"{a} error in nm", level=0.0)]
        for a in AXES
    ]
    if ("drive", "x") in signals:
        drives = [
            signals["drive", axis].curve(1.0, axis, colour)
            for axis, colour in zip(AXES, (BLUE, ORANGE), strict=True)
        ]
        rows.append([Panel(drives, TIME, "drive in V")])
    return Picture("whole", sentence("caption.whole"), rows, LOW)


@define(eq=False)
class _ErrorImager:
    """Images the error of both axes at the desired positions, line by line."""

    spec: ScanSpec
    frame: Frame
    lines: dict[str, list[ImageLine]] = field(factory=lambda: {axis: [] for axis in AXES})
    _imagers: dict[str, LineImager] = field(init=False)

    def __attrs_post_init__(self) -> None:
        self._imagers = {axis: LineImager(self.spec, self.frame) for axis in AXES}

    def add(self, desired: Trace, achieved: Trace) -> None:
        """Take a block."""
        if on_lines := within(phases(self.spec).lines, (desired, achieved)):
            wanted, moved = on_lines
            for axis, imager in self._imagers.items():
                error = NANO * (moved.axis(axis) - wanted.axis(axis))
                self.lines[axis] += imager.add(wanted.x, error)

    def picture(self) -> Picture:
        """Show the x error on trace and retrace as images, and both axes' error of a line."""
        x = "desired x in µm"
        maps = {axis: self._maps(axis) for axis in AXES}
        images = image_row(maps["x"], [f"x error, {way}" for way in WAYS], x, "line")
        lines = [
            Panel(picked_lines(maps[axis], WAYS), x, f"{axis} error in nm", level=0.0)
            for axis in AXES
        ]
        return Picture("by_line", sentence("caption.by_line"), (images, lines))

    def _maps(self, axis: str) -> list[Map]:
        """Return the error on trace and on retrace, in the same colours."""
        both = [np.stack([getattr(line, way) for line in self.lines[axis]]) for way in WAYS]
        most = float(np.nanmax(np.abs(both), initial=np.finfo(float).tiny))
        span = MICRO * self.frame.left, MICRO * self.frame.right, 0.0, float(len(both[0]))
        return [
            Map(values, span, "error in nm", -most, most, signed=True, peaks=True)
            for values in both
        ]
