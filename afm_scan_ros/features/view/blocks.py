"""What is shown of blocks of samples, of a bag or a pipeline, some of which may be missing.

Of a bag also what monitors recorded.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from afm_scan_ros.bag.folder import bag_files
from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.bag.scan_info import LINE
from afm_scan_ros.bag.typestore import IMAGE, decode, heights, line_of, way_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.image_lines import frame_of, most_pixels, pixel_means
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import (
    ACHIEVED,
    DESIRED,
    DRIVE,
    Aligner,
    WholeLines,
    end,
    line_error,
    monitor_step,
    part,
)
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases
from afm_scan_ros.core.types import Trace
from afm_scan_ros.features.view.screen import ERROR, Screen, open_screen
from afm_scan_ros.features.view.viewer import ViewSettings

COMPARED = (DESIRED, ACHIEVED)


class ShownBlocks:
    """Takes the blocks of each stream of one scan, and shows them on a screen.

    Curves have each sample that is a multiple of the step of the topic ``monitor``. Where a block
    is missing, errors are known again from where both streams are, or from the next line on.
    """

    def __init__(self, screen: Screen, pixels: int) -> None:
        info = screen.info
        self._screen, self._step = screen, monitor_step(info.sample_period)
        self._next = dict.fromkeys(COMPARED, 0)
        self._from, self._aligner = 0, Aligner(COMPARED)
        self._lines = None if info.spec is None else ShownLines(info.spec, screen, pixels)

    def add(self, name: str, block: Trace) -> None:
        """Show the next block of a stream."""
        self._curve(name, block)
        if name not in COMPARED:
            return
        if block.first_sample != self._next[name]:
            self._resume(max(block.first_sample, *self._next.values()))
        self._next[name] = end(block)
        if end(block) > self._from:
            first = max(block.first_sample, self._from)
            self._aligner.add(name, part(block, first, end(block)))
        for desired, achieved in self._aligner.ready():
            error = Trace(
                desired.first_sample,
                desired.sample_period,
                achieved.x - desired.x,
                achieved.y - desired.y,
            )
            self._curve(ERROR, error)
            if self._lines is not None:
                self._lines.add(desired, error)

    def _curve(self, name: str, trace: Trace) -> None:
        first = -trace.first_sample % self._step
        samples = np.arange(trace.first_sample, end(trace), dtype=np.int64)[first :: self._step]
        if samples.size:
            self._screen.curve(name, samples, *(trace.axis(a)[first :: self._step] for a in "xy"))

    def _resume(self, sample: int) -> None:
        """Compare from a sample on, or from the line after it, which then is whole."""
        self._from = sample if self._lines is None else self._lines.begins(sample)
        self._aligner = Aligner(COMPARED)


class ShownLines:
    """Shows the error of each whole line: its figures, and that in x on the trace as an image."""

    def __init__(self, spec: ScanSpec, screen: Screen, pixels: int) -> None:
        self._spec, self._screen = spec, screen
        self._where = phases(spec).lines
        self._whole = WholeLines(self._where, spec.samples_per_line, 3)
        self._frame = None
        if spec.pattern in TO_AND_FRO:
            self._frame = frame_of(spec, min(pixels, most_pixels(spec)))
            self._image = np.full((spec.lines, self._frame.pixels), np.nan)

    def begins(self, sample: int) -> int:
        """Return the sample, or the first one of the next line where it is within a line."""
        if sample not in self._where:
            return sample
        return sample + (self._where.start - sample) % self._spec.samples_per_line

    def add(self, desired: Trace, error: Trace) -> None:
        """Take the next run of samples."""
        rows = np.stack([desired.x, error.x, error.y])
        for number, line in self._whole.add(desired.first_sample, rows):
            first = self._where.start + number * self._spec.samples_per_line
            self._screen.line("tracking_error", line_error(number, first, line[1:]))
            if self._frame is not None:
                trace = slice(None, line[0].size // 2 + 1)
                self._image[number] = pixel_means(line[0][trace], line[1][trace], self._frame)
                self._screen.image("error_x", self._image)


RESIDUAL = "model_residual"


def show_bag(
    bag: Path, where: str, settings: ViewSettings, wanted: Callable[[], bool]
) -> tuple[str, ...]:
    """Show a bag as long as it is ``wanted``; return what is to be known of it.

    Raises InputError where it holds no stream, or a damaged one.
    """
    recording = read_scan(bag)
    names = [name for name in (DESIRED, DRIVE, ACHIEVED) if name in recording.topics]
    if not names:
        raise InputError(f"{bag}: holds no {DESIRED}, {DRIVE} or {ACHIEVED} to show")
    screen = open_screen(recording.info, where, settings)
    shown, due, sample = ShownBlocks(screen, settings.pixels), 0.0, 0
    for run in recording.blocks(*names):
        for name, trace in zip(names, run, strict=True):
            shown.add(name, trace)
        sample = end(run[0])
        if time.monotonic() >= due:
            screen.state("bag", "is read", sample, "")
            screen.refresh()
            due = time.monotonic() + settings.refresh
        if not wanted():
            break
    _show_findings(recording, screen)
    for warning in recording.warnings:
        screen.say(warning, sample)
    screen.state("bag", "is shown", sample, "")
    screen.refresh(last=True)
    return recording.warnings


def _show_findings(recording: ScanRecording, screen: Screen) -> None:
    """Show the residual of each line, and images, where they were recorded."""
    for message in (m for file in bag_files(recording.path)[0] for m in messages(file)):
        if message.type_name == LINE and message.topic.endswith(f"/{RESIDUAL}"):
            screen.line(RESIDUAL, line_of(recording.info, decode(LINE, message.cdr)))
        elif message.type_name == IMAGE and (way := way_of(message.topic)):
            screen.image(way, heights(decode(IMAGE, message.cdr)))
