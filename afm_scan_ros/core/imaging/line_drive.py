"""The drive of x while an image is taken, line after line, and what of it the image shows."""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.imaging.grating.motion import middles
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array

PER_PIXEL = 8
"""Samples of a pixel: a drive that is held for one of them lags little behind the line."""
LINES = 3
"""To-and-fro lines: the first one writes the memory of the next."""


@frozen(eq=False)
class LineDrive:
    """Drive (V) of a way from rest to the first turn and of some to-and-fro lines, (samples,).

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
        """Which samples are imaged, and not of the first line or the way to it: (samples,)."""
        way = np.zeros(self._one_way, dtype=bool)
        way[self.beyond * PER_PIXEL : (self.beyond + self.pixels) * PER_PIXEL] = True
        shown = np.tile(way, 2 * (LINES - 1))
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
