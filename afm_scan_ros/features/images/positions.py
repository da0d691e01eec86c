"""Where a scanner was while an image was taken, by a model, and the image at such positions."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.motion import middles
from afm_scan_ros.features.images.scan_image import ScanImage, line_time_of

PER_PIXEL = 8
"""Samples of a pixel: a drive that is held for one of them lags little behind the line."""
LINES = 3
"""To-and-fro lines: the first ones write the memory of the last one."""
STEPS = 100
"""Most steps of the search for the pixel at a position."""
FOUND = 1e-3
"""Pixels, within which a position is found."""


@frozen(eq=False)
class LineDrive:
    """Drive of x (V), a way from rest to the first turn and some to-and-fro lines, (samples,).

    ``sample_period`` is in s. A line holds ``beyond`` pixels before and behind those imaged.
    """

    drive: Array
    sample_period: float
    pixels: int
    beyond: int

    @classmethod
    def of(cls, image: ScanImage, scale: float, line_time: float) -> "LineDrive":
        """Take an image's lines; ``scale`` (V/m) is the drive over the commanded position."""
        beyond = round(image.pixels * image.overscan)
        whole = image.pixels + 2 * beyond
        count = whole * PER_PIXEL
        place = 0.5 * image.range_x * scale * whole / image.pixels * middles(count)
        line = np.concatenate([place, place[::-1]])
        drive = np.concatenate([line[-(count // 2) :], np.tile(line, LINES)])
        return cls(drive, line_time / (2 * count), image.pixels, beyond)

    @property
    def _one_way(self) -> int:
        return (self.pixels + 2 * self.beyond) * PER_PIXEL

    def imaged(self) -> NDArray[np.bool_]:
        """Which samples of the last line are imaged: (samples,). The others only repeat it."""
        way = np.zeros(self._one_way, dtype=bool)
        way[self.beyond * PER_PIXEL : (self.beyond + self.pixels) * PER_PIXEL] = True
        shown = np.tile(way, 2)
        return np.concatenate([np.zeros(len(self.drive) - len(shown), dtype=bool), shown])

    def moved(self, trace: Array, retrace: Array) -> Array:
        """Displacement at all samples, from that at the pixels of a line, (pixels,) each."""
        fine = (np.arange(self._one_way) + 0.5) / PER_PIXEL - 0.5 - self.beyond
        sides = [np.interp(fine, np.arange(self.pixels), each) for each in (trace, retrace)]
        line = np.concatenate([sides[0], sides[1][::-1]])
        before = line[-(len(self.drive) - LINES * len(line)) :]
        return np.concatenate([before, np.tile(line, LINES)])

    def at_pixels(self, signal: Array) -> tuple[Array, Array]:
        """Mean of a signal (samples,) over each pixel of the last trace and retrace: (pixels,)."""
        line = signal[-2 * self._one_way :].reshape(2, -1, PER_PIXEL).mean(axis=2)
        inner = line[:, self.beyond : self.beyond + self.pixels]
        return inner[0], inner[1, ::-1]


def rows_of(image: ScanImage, scale: float) -> Array:
    """Drive (V) of y in each line, from the lowest to the highest: (lines,)."""
    return np.asarray(0.5 * image.range_y * scale * middles(image.lines))


def predicted_positions(
    model: ScannerModel, image: ScanImage, volts_per_metre: tuple[float, float]
) -> tuple[Array, Array]:
    """Positions (lines, pixels, 2) of trace and retrace, m, zero on average.

    ``volts_per_metre`` (V/m) turn commanded positions of x and y into drives. The lines repeat, and
    no axis moves the other. Raises InputError where the time of a line is not known, or where the
    drive leaves the range of the model.
    """
    line_time = line_time_of(image)
    line = LineDrive.of(image, volts_per_metre[0], line_time)
    there, back = line.at_pixels(_moved(model.axis("x"), line.drive, line.sample_period))
    rows = _rows(model, image, volts_per_metre[1], line_time)
    middle = 0.5 * (there.mean() + back.mean())
    both = (np.broadcast_to(each - middle, image.trace.shape) for each in (there, back))
    y = np.broadcast_to((rows - rows.mean())[:, np.newaxis], image.trace.shape)
    trace, retrace = (np.stack([x, y], axis=2) for x in both)
    return trace, retrace


def _rows(model: ScannerModel, image: ScanImage, scale: float, line_time: float) -> Array:
    """Displacement of y in each line, (lines,), a line after the drive that moves it."""
    drive = rows_of(image, scale)
    in_time = drive if image.upward else drive[::-1]
    moved = _moved(model.axis("y"), np.append(in_time, in_time[-1]), line_time)[1:]
    return moved if image.upward else moved[::-1]


def _moved(axis: AxisModel, drive: Array, period: float) -> Array:
    chain = forward(axis, period)
    return chain.apply(chain.at_rest(), np.ascontiguousarray(drive))[1]


@frozen
class Rectangle:
    """Rectangle that is imaged, m: from ``left`` to ``right`` and from ``bottom`` to ``top``."""

    left: float
    right: float
    bottom: float
    top: float


def common_rectangle(positions: Sequence[Array]) -> Rectangle:
    """Largest upright rectangle inside all edges of images of positions (lines, pixels, 2), m.

    Raises InputError where there is none.
    """
    found = Rectangle(
        left=max(float(each[:, 0, 0].max()) for each in positions),
        right=min(float(each[:, -1, 0].min()) for each in positions),
        bottom=max(float(each[0, :, 1].max()) for each in positions),
        top=min(float(each[-1, :, 1].min()) for each in positions),
    )
    if found.left >= found.right or found.bottom >= found.top:
        raise InputError("the lines of the image have no part in common: nothing can be imaged")
    return found


def regridded(heights: Array, positions: Array, area: Rectangle) -> Array:
    """Heights (lines, pixels) on a grid of as many points over an area.

    ``positions`` (lines, pixels, 2), x and y in m, are those of the heights. At each point of the
    grid the pixel is sought whose position it is, and the height taken between the pixels, linear.
    Raises InputError where a position is not found.
    """
    lines, pixels = heights.shape
    x, y = np.meshgrid(
        np.linspace(area.left, area.right, pixels), np.linspace(area.bottom, area.top, lines)
    )
    step_x = float(np.mean(np.diff(positions[..., 0], axis=1)))
    step_y = float(np.mean(np.diff(positions[..., 1], axis=0)))
    row, column = np.meshgrid(np.arange(lines) + 0.0, np.arange(pixels) + 0.0, indexing="ij")
    for _ in range(STEPS):
        here = np.stack([row, column])
        missed_x = (x - _at(positions[..., 0], here)) / step_x
        missed_y = (y - _at(positions[..., 1], here)) / step_y
        row = np.clip(row + missed_y, 0.0, lines - 1.0)
        column = np.clip(column + missed_x, 0.0, pixels - 1.0)
        if max(float(np.abs(missed_x).max()), float(np.abs(missed_y).max())) < FOUND:
            return _at(heights, np.stack([row, column]))
    raise InputError(
        "the positions in the image are too irregular to be put on a grid: give an image of a"
        " smaller range or a slower scan"
    )


def _at(values: Array, places: Array) -> Array:
    return np.asarray(map_coordinates(values, places, order=1, mode="nearest"))
