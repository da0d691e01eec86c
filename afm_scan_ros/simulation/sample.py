"""Samples to be imaged: each gives its height, m, at any place in its plane.

x and y are positions of the tip over the sample, m, zero where the scanner rests. The tip is taken
as sharp, and its height as read without error: what an image shows is the scan alone.
"""

import numpy as np
from attrs import field, frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array


@frozen
class Grating:
    """Parallel bars of chrome on glass, rising from 0 to ``thickness`` over ``edge`` (all in m).

    The bars run at ``angle`` (rad) to the y axis; ``x = (y_0 - y) tan(angle)`` goes along them.
    The middle of one bar lies ``offset`` from the origin, measured across the bars.
    """

    pitch: float = field(default=16e-6, validator=gt(0.0))
    thickness: float = field(default=100e-9, validator=gt(0.0))
    angle: float = 0.0
    offset: float = 0.0
    edge: float = field(default=0.4e-6, validator=gt(0.0))

    def height(self, x: Array, y: Array) -> Array:
        """Height above the glass: half of each pitch is chrome."""
        across = x * np.cos(self.angle) + y * np.sin(self.angle) - self.offset
        from_middle = np.abs(across - self.pitch * np.rint(across / self.pitch))
        inside = (0.25 * self.pitch - from_middle) / self.edge
        result: Array = self.thickness * np.clip(0.5 + inside, 0.0, 1.0)
        return result


@frozen(eq=False)
class HeightMap:
    """Heights (m), (rows, columns), centred on the origin: row 0 at the lowest y, column 0 at x.

    ``width`` is the distance of the first column from the last, m; rows lie as far apart.
    """

    heights: Array
    width: float = field(validator=gt(0.0))

    def __attrs_post_init__(self) -> None:
        if self.heights.ndim != 2 or min(self.heights.shape) < 2:  # noqa: PLR2004 - a plane
            raise InputError(f"a height map needs rows and columns, not shape {self.heights.shape}")
        wrong = np.argwhere(~np.isfinite(self.heights))
        if len(wrong):
            row, column = (int(place) for place in wrong[0])
            raise InputError(f"the height in row {row}, column {column} is not a finite number")

    def height(self, x: Array, y: Array) -> Array:
        """Height between the grid's points, bilinear; raises ScanError beyond the grid."""
        rows, columns = self.heights.shape
        spacing = self.width / (columns - 1)
        across = _within(x, spacing, columns, "x")
        along = _within(y, spacing, rows, "y")
        column = np.minimum(across.astype(np.int64), columns - 2)
        row = np.minimum(along.astype(np.int64), rows - 2)
        right, up = across - column, along - row
        corners = self.heights
        lower = (1.0 - right) * corners[row, column] + right * corners[row, column + 1]
        upper = (1.0 - right) * corners[row + 1, column] + right * corners[row + 1, column + 1]
        result: Array = (1.0 - up) * lower + up * upper
        return result


def _within(position: Array, spacing: float, count: int, axis: str) -> Array:
    """Return positions in grid spacings from the first line of the grid."""
    half = 0.5 * spacing * (count - 1)
    beyond = np.flatnonzero(np.abs(position) > half)
    if beyond.size:
        raise ScanError(
            f"{axis} = {1e6 * position.flat[beyond[0]]:.4g} µm lies beyond the sample, which ends"
            f" at {1e6 * half:.4g} µm: give it a larger sample_width_um or scan less"
        )
    result: Array = (position + half) / spacing
    return result
