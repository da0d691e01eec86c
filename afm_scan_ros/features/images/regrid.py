"""An image on a regular grid, from heights at positions that are not regular."""

import numpy as np
from attrs import frozen
from scipy.ndimage import map_coordinates

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

STEPS = 100
"""Most steps of the search for the pixel at a position."""
FOUND = 1e-3
"""Pixels, within which a position is found."""


@frozen
class Rectangle:
    """Rectangle that is imaged, m: from ``left`` to ``right`` and from ``bottom`` to ``top``."""

    left: float
    right: float
    bottom: float
    top: float


def common_rectangle(positions: list[Array]) -> Rectangle:
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
