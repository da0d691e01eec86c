"""A scan by a controller that knows a nominal sensitivity alone, and the image that it stores.

The fast axis follows a triangle. The slow one moves from line to line in a step, spread over the
overscan about the turn-around. The scanner is simulated line by line.
"""

from math import ceil
from typing import Protocol

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_bench.images.detection import Detection, detected
from afm_scan_bench.images.tube_scanner import TubeScanner, TubeState
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.scan_image import ScanImage

READ = 10
"""Heights that are read in a pixel, evenly spaced."""
PER_PERIOD = 8
"""Samples a period of the fastest resonance at the least."""
APPROACH = 1.0
"""Time (s) of the way to the first line."""


class Surface(Protocol):
    """A sample to be imaged."""

    def height(self, x: Array, y: Array) -> Array:
        """Height (m) at places (m) of one shape."""


@frozen
class Frame:
    """What the controller is told: ranges (m), lines, pixels, line time (s), way, overscan (1).

    A pixel's commanded place is its middle, and the pixels fill the ranges about 0 m.
    """

    range_x: float
    range_y: float
    lines: int = 256
    pixels: int = 256
    line_time: float = 1.0
    upward: bool = True
    overscan: float = 0.0

    def row(self, number: int) -> int:
        """Row of the image that the line of this number in time gives."""
        return number if self.upward else self.lines - 1 - number

    def level(self, number: float) -> float:
        """Commanded y (m) of the line of this number in time."""
        share = (number + 0.5) / self.lines - 0.5
        return self.range_y * (share if self.upward else -share)


@frozen(eq=False)
class Acquired:
    """An image, the true places (m) of its pixels, and the scanner's state after its last line.

    Places are (2, lines, pixels), x then y, rows and columns as in the image.
    """

    image: ScanImage
    true_trace: Array
    true_retrace: Array
    after: TubeState


@frozen(eq=False)
class _Clock:
    """Samples of a line: a pixel's, those of the overscan at each end, and their period (s)."""

    per_pixel: int
    margin: int
    sample_period: float

    @classmethod
    def of(cls, frame: Frame, fastest: float) -> "_Clock":
        """Resolve the resonance ``fastest`` (Hz); an odd number a reading has one in its middle."""
        pixel_time = 0.5 * frame.line_time / (frame.pixels * (1.0 + 2.0 * frame.overscan))
        per_reading = ceil(PER_PERIOD * fastest * pixel_time / READ)
        per_pixel = READ * (per_reading + 1 - per_reading % 2)
        margin = round(frame.overscan * frame.pixels * per_pixel)
        half = frame.pixels * per_pixel + 2 * margin
        return cls(per_pixel, margin, 0.5 * frame.line_time / half)

    def line(self, frame: Frame, number: int) -> Array:
        """Commanded places (m) of a line's samples, each at the middle of its time, (2, n)."""
        inner = frame.pixels * self.per_pixel
        half = inner + 2 * self.margin
        way = np.abs(np.mod(np.arange(2 * half) + 0.5 + half, 2 * half) - half)
        x = frame.range_x * (way - 0.5 * half) / inner
        y = np.full(2 * half, frame.level(number))
        rise = (
            (np.arange(2 * self.margin) + 0.5) / (2 * self.margin) if self.margin else np.empty(0)
        )
        if number > 0:
            y[: self.margin] = frame.level(number - 1) + rise[self.margin :] * self._step(frame)
        if number < frame.lines - 1 and self.margin:
            y[-self.margin :] = frame.level(number) + rise[: self.margin] * self._step(frame)
        return np.stack([x, y])

    @staticmethod
    def _step(frame: Frame) -> float:
        return frame.level(1) - frame.level(0)

    def readings(self, frame: Frame) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Samples of a line that are read for each column in trace and retrace, (pixels, READ)."""
        step = self.per_pixel // READ
        first = np.arange(frame.pixels * READ) * step + step // 2 + self.margin
        trace = first.reshape(frame.pixels, READ)
        total = 2 * (frame.pixels * self.per_pixel + 2 * self.margin)
        return trace, total - 1 - trace


def acquire(
    scanner: TubeScanner,
    state: TubeState,
    frame: Frame,
    surface: Surface,
    detection: Detection,
    rng: np.random.Generator,
) -> Acquired:
    """Scan a frame from a state on, whose first line begins at once."""
    clock = _Clock.of(frame, scanner.fastest)
    shape = frame.lines, frame.pixels
    heights, places = np.empty((2, *shape)), np.empty((2, 2, *shape))
    for number in range(frame.lines):
        row = frame.row(number)
        drive = driven(scanner, clock.line(frame, number))
        state, place = _moved(scanner, state, drive, clock.sample_period)
        for way, samples in enumerate(clock.readings(frame)):
            x, y = place[:, samples]
            bow = detection.bow * (x**2 + y**2)
            heights[way, row] = (surface.height(x, y) + bow).mean(axis=1)
            places[way, :, row] = x.mean(axis=1), y.mean(axis=1)
    trace, retrace = (detected(each, detection, rng) for each in heights)
    image = ScanImage(
        trace, retrace, frame.range_x, frame.range_y, frame.line_time, frame.upward, frame.overscan
    )
    return Acquired(image, places[0], places[1], state)


def _moved(
    scanner: TubeScanner, state: TubeState, drive: Array, sample_period: float
) -> tuple[TubeState, Array]:
    """State after a block, and places (m) in the middle of the time of each drive sample."""
    after, place = scanner.advance(state, drive, sample_period)
    ends = np.column_stack([place, scanner.place(after)])
    return after, 0.5 * (ends[:, 1:] + ends[:, :-1])


def driven(scanner: TubeScanner, commanded: Array) -> Array:
    """Drive (V) that the controller gives for commanded places (m), both (2, n)."""
    return np.asarray(commanded / np.reshape(scanner.nominal, (2, 1)))


def approached(
    scanner: TubeScanner, state: TubeState, frame: Frame, start: Array, wait: float
) -> TubeState:
    """State before the first line: a straight way from the place commanded last, and a wait (s).

    ``start`` is that place (m), (2,).
    """
    end = np.array([-frame.range_x * (0.5 + frame.overscan), frame.level(0)])
    steps = ceil(PER_PERIOD * scanner.fastest * APPROACH)
    share = (np.arange(steps) + 1.0) / steps
    way = start[:, np.newaxis] + np.outer(end - start, share)
    state, _ = scanner.advance(state, driven(scanner, way), APPROACH / steps)
    if wait > 0.0:
        state, _ = scanner.advance(state, driven(scanner, end[:, np.newaxis]), wait)
    return state
