"""Fewer points and pixels of a picture, of which no eye misses any: each peak stays."""

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array, setting
from afm_scan_ros.report.picture import Curve, Map, Mark, PickedLine, Picture


@frozen
class DrawingSettings:
    """Sizes of what a page draws, by which it has at most 3 MB whatever the recording."""

    stretches: int = setting(
        3000,
        "1",
        "stretches of a long curve, of each of which the lowest and the highest sample are drawn",
        "a screen has some 3000 columns, and a curve then takes 64 kB",
    )
    pixels: int = setting(
        180_000,
        "pixels",
        "of all images of a page together",
        "they take 1 MB",
    )
    side: int = setting(
        256, "pixels", "along a side of an image, at most", "an image is some 400 pixels wide"
    )
    error_pixels: int = setting(
        128,
        "pixels",
        "in a line of the image of an error, at most",
        "the errors of both axes on trace and retrace take 700 kB",
    )
    longest: float = setting(
        3.0, "1", "sides of an image, at most; longer ones are squeezed", "an image stays legible"
    )
    row: int = setting(
        200, "pixels", "height of a row of panels", "answer and figure fit into 800 pixels"
    )


DRAWING = DrawingSettings()


def extremes(y: Array, bins: int) -> NDArray[np.intp]:
    """Return the places of the lowest and the highest value of each of so many stretches.

    They rise, and the first and the last sample are among them. A stretch of NaN alone gives its
    first place. The peaks of a curve that is drawn through these places are those of all samples.
    """
    if y.size <= 2 * bins:
        return np.arange(y.size)
    starts = np.linspace(0, y.size, bins + 1).astype(int)[:-1]
    lengths = np.diff(np.append(starts, y.size))
    within = np.arange(lengths.max())
    places = np.minimum(starts[:, np.newaxis] + within, y.size - 1)
    inside = within < lengths[:, np.newaxis]
    known = np.isfinite(y[places]) & inside
    lowest = np.argmin(np.where(known, y[places], np.inf), axis=1)
    highest = np.argmax(np.where(known, y[places], -np.inf), axis=1)
    found: NDArray[np.intp] = np.unique([*(starts + lowest), *(starts + highest), 0, y.size - 1])
    return found


def thinned(curve: Curve, bins: int = DRAWING.stretches) -> Curve:
    """Return a curve with no more points than are seen: each peak stays."""
    kept = extremes(curve.y, bins)
    return evolve(curve, x=curve.x[kept], y=curve.y[kept])


def coarse(picture: Picture, finest: int) -> Picture:
    """Return a picture whose images have no more lines and pixels.

    Each is the mean of some, or the largest of them in an image of peaks.
    """
    seen: dict[int, Map] = {}

    def reduced(of: Map) -> Map:
        if id(of) not in seen:
            shown = (block_peaks if of.peaks else block_means)(of.values, finest)
            seen[id(of)] = evolve(of, values=shown)
        return seen[id(of)]

    def drawn_by(mark: Mark) -> Mark:
        if isinstance(mark, PickedLine):
            return evolve(mark, of=reduced(mark.of))
        return reduced(mark) if isinstance(mark, Map) else mark

    rows = [
        [evolve(panel, marks=[drawn_by(mark) for mark in panel.marks]) for panel in row]
        for row in picture.rows
    ]
    return evolve(picture, rows=rows)


def block_means(values: Array, finest: int) -> Array:
    """Return the means of neighbouring lines and pixels, so few that none exceeds ``finest``."""
    for axis, count in enumerate(values.shape):
        starts = _starts(count, finest)
        sizes = np.diff(np.append(starts, count))
        shape = (-1, 1) if axis == 0 else (1, -1)
        values = np.add.reduceat(values, starts, axis=axis) / sizes.reshape(shape)
    return values


def block_peaks(values: Array, finest: int) -> Array:
    """Return of neighbouring lines and pixels the value that is largest, whatever its sign."""
    for axis, count in enumerate(values.shape):
        starts = _starts(count, finest)
        low, high = (f.reduceat(values, starts, axis=axis) for f in (np.fmin, np.fmax))
        values = np.where(-low > high, low, high)
    return values


def _starts(count: int, finest: int) -> NDArray[np.intp]:
    starts: NDArray[np.intp] = np.linspace(0, count, min(count, finest) + 1).astype(np.intp)[:-1]
    return starts
