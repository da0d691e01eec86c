"""The image of a to-and-fro scan, line by line, at the desired positions.

A height read at the achieved position is placed at the desired one (Croft, Shed and Devasia 2001),
so tracking errors appear as distortion of the image.
"""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from attrs import define, field, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, Aligner, WholeLines, within
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases
from afm_scan_ros.core.types import Array, Trace


@frozen
class Frame:
    """The part of each line that is imaged, from ``left`` to ``right`` (m), and its pixels."""

    left: float
    right: float
    pixels: int

    @property
    def edges(self) -> Array:
        """Where the pixels end and begin, m, shape (pixels + 1,)."""
        return np.linspace(self.left, self.right, self.pixels + 1)

    @property
    def centres(self) -> Array:
        """Middle of each pixel, m, shape (pixels,)."""
        edges = self.edges
        result: Array = 0.5 * (edges[1:] + edges[:-1])
        return result


def most_pixels(spec: ScanSpec) -> int:
    """Return the largest number of pixels in a line: a trace has more samples to image."""
    return int(0.5 * spec.samples_per_line * (1.0 - 2.0 * spec.overscan)) - 1


def frame_of(spec: ScanSpec, pixels: int) -> Frame:
    """Return what a scan images of its lines, all but the overscan.

    Raises InputError for a pattern without lines, and for more pixels than a trace has samples.
    """
    if spec.pattern not in TO_AND_FRO:
        raise InputError(
            f"pattern '{spec.pattern}' has no lines to image: use {' or '.join(TO_AND_FRO)}"
        )
    most = most_pixels(spec)
    if pixels > most:
        raise InputError(
            f"pixels = {pixels}: a trace has {most + 1} samples to image, give fewer pixels"
        )
    half = (0.5 - spec.overscan) * spec.range_x
    return Frame(spec.centre_x - half, spec.centre_x + half, pixels)


def pixel_means(position: Array, values: Array, frame: Frame) -> Array:
    """Mean over each pixel of values at rising positions (m), straight between them.

    Of a pixel that they cover in part, over that part; NaN where they do not reach it.
    """
    edges = np.clip(frame.edges, position[0], position[-1])
    corners = np.union1d(position, edges)
    heights = np.interp(corners, position, values)
    steps = 0.5 * np.diff(corners) * (heights[1:] + heights[:-1])
    area = np.concatenate([[0.0], np.cumsum(steps)])[np.searchsorted(corners, edges)]
    widths, means = np.diff(edges), np.full(frame.pixels, np.nan)
    np.divide(np.diff(area), widths, out=means, where=widths > 0.0)
    return means


@frozen(eq=False)
class ImageLine:
    """One line of both images: pixels from left to right, shape (pixels,) each."""

    number: int
    trace: Array
    retrace: Array


@define
class LineImager:
    """Gathers values along the lines block by block, and gives up each line once it is whole."""

    spec: ScanSpec
    frame: Frame
    _taken: int = 0
    _whole: WholeLines = field(init=False)

    def __attrs_post_init__(self) -> None:
        samples = range(self.spec.lines * self.spec.samples_per_line)
        self._whole = WholeLines(samples, self.spec.samples_per_line, 2)

    def add(self, desired_x: Array, values: Array) -> Iterator[ImageLine]:
        """Take the next samples of the lines, (n,) each; yield the lines that they make whole."""
        first = self._taken
        self._taken += desired_x.size
        for number, line in self._whole.add(first, np.stack([desired_x, values])):
            yield self._line(number, *line)

    def _line(self, number: int, position: Array, values: Array) -> ImageLine:
        corner = self.spec.samples_per_line // 2
        back = slice(None, corner - 1, -1)
        return ImageLine(
            number,
            pixel_means(position[: corner + 1], values[: corner + 1], self.frame),
            pixel_means(position[back], values[back], self.frame),
        )


class Imaged(Protocol):
    """What is imaged."""

    def height(self, x: Array, y: Array) -> Array:
        """Height (m) at positions (m), all (n,)."""
        ...


class ImageLines:
    """Reads heights on the lines at the achieved position, and places them at the desired."""

    def __init__(self, spec: ScanSpec, frame: Frame, sample: Imaged) -> None:
        self._sample = sample
        self._where = phases(spec).lines
        self._imager = LineImager(spec, frame)
        self._aligner = Aligner((DESIRED, ACHIEVED))

    def add(self, name: str, block: Trace) -> Iterator[ImageLine]:
        """Take a block of one of the two topics; yield the lines that it makes whole."""
        self._aligner.add(name, block)
        for run in self._aligner.ready():
            if on_lines := within(self._where, run):
                desired, achieved = on_lines
                heights = self._sample.height(achieved.x, achieved.y)
                yield from self._imager.add(desired.x, heights)
