"""Two-dimensional calibration gratings, drawn with defects and dust: height (m) at any place (m).

The grating's own axes are turned by ``angle`` (rad) against x and y, anticlockwise. A cell is the
smallest square that repeats along both of them; its side is ``pitch``. Of a chessboard it holds two
dark and two bright squares.
"""

from collections.abc import Callable, Mapping

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array

Profile = Callable[[Array, Array, float], Array]


def _square(u: Array, v: Array, width: float) -> Array:
    return np.asarray(0.5 * width - np.maximum(np.abs(u), np.abs(v)))


def _round(u: Array, v: Array, width: float) -> Array:
    return np.asarray(0.5 * width - np.hypot(u, v))


def _rounded(u: Array, v: Array, width: float) -> Array:
    return np.asarray(0.5 * width - (u**4 + v**4) ** 0.25)


def _chessboard(u: Array, v: Array, width: float) -> Array:
    """Distance to the nearer edge, of one sign in squares that touch at a corner."""
    across, along = 0.25 - np.abs(np.abs(u) - 0.25), 0.25 - np.abs(np.abs(v) - 0.25)
    bright = np.where(u * v > 0.0, 1.0, -1.0)
    return np.asarray(bright * np.minimum(across, along) + 0.25 * (width - 0.5))


@frozen
class Kind:
    """Distance inside a feature's edge over the pitch, its sign of height, its edge if wide.

    ``slope`` is the width of the edge over the pitch where it is a feature's whole side.
    """

    profile: Profile
    sign: float
    slope: float | None = None


KINDS: Mapping[str, Kind] = {
    "square_posts": Kind(_square, 1.0),
    "round_posts": Kind(_round, 1.0),
    "square_holes": Kind(_square, -1.0),
    "round_holes": Kind(_round, -1.0),
    "rounded_squares": Kind(_rounded, 1.0),
    "pyramids": Kind(_square, -1.0, 0.3),
    "chessboard": Kind(_chessboard, 1.0),
}
"""Forms of a cell by name."""

TABLE = 32
"""Cells along an axis after which missing and damaged cells repeat: more than an image shows."""
FAR = 3.0
"""Standard deviations from a particle's middle, beyond which its height is below 1.2 %."""


@frozen(eq=False)
class Particles:
    """Dust: ``x``, ``y``, ``radius`` and ``height`` (m) of each particle, (n,)."""

    x: Array
    y: Array
    radius: Array
    height: Array

    def above(self, x: Array, y: Array) -> Array:
        """Height (m) above the grating, of the shape of the places."""
        total = np.zeros(x.shape)
        reach = FAR * self.radius
        near = (np.abs(self.y - np.clip(self.y, y.min(), y.max())) < reach) & (
            np.abs(self.x - np.clip(self.x, x.min(), x.max())) < reach
        )
        for k in np.flatnonzero(near):
            inside = (np.abs(x - self.x[k]) < reach[k]) & (np.abs(y - self.y[k]) < reach[k])
            apart = (x[inside] - self.x[k]) ** 2 + (y[inside] - self.y[k]) ** 2
            total[inside] += self.height[k] * np.exp(-0.5 * apart / self.radius[k] ** 2)
        return total


@frozen(eq=False)
class CellGrating:
    """Cells of ``kind``, ``pitch``, ``depth`` and ``edge`` (m); ``width`` over the pitch.

    A cell's middle lies at ``origin`` (m). ``heights`` and ``widths`` scale each cell of a table
    that repeats, 0 in ``heights`` where it is missing. ``tilt`` (1) is the sample's.
    """

    kind: str
    pitch: float
    depth: float
    edge: float
    width: float
    angle: float
    origin: tuple[float, float]
    heights: Array
    widths: Array
    dust: Particles
    tilt: tuple[float, float] = (0.0, 0.0)

    def height(self, x: Array, y: Array) -> Array:
        """Height (m) at places (m) of one shape."""
        flat = self.tilt[0] * x + self.tilt[1] * y
        return np.asarray(flat + self._pattern(x, y) + self.dust.above(x, y))

    def _pattern(self, x: Array, y: Array) -> Array:
        cos, sin = np.cos(self.angle) / self.pitch, np.sin(self.angle) / self.pitch
        right, up = x - self.origin[0], y - self.origin[1]
        u, v = cos * right + sin * up, cos * up - sin * right
        column, row = np.rint(u), np.rint(v)
        cell = np.mod(row, TABLE).astype(np.intp), np.mod(column, TABLE).astype(np.intp)
        kind = KINDS[self.kind]
        inside = kind.profile(u - column, v - row, self.width) * self.widths[cell]
        return np.asarray(kind.sign * self.depth * self.heights[cell] * self._rise(inside))

    def _rise(self, inside: Array) -> Array:
        """Rise from 0 to 1 over the edge, whose middle is the feature's edge, without a corner."""
        slope = KINDS[self.kind].slope
        if slope is not None:
            return np.asarray(np.clip(inside / slope, 0.0, 1.0))
        share = np.clip(0.5 + inside * self.pitch / self.edge, 0.0, 1.0)
        return np.asarray(share * share * (3.0 - 2.0 * share))


def drawn_grating(
    rng: np.random.Generator, kind: str, pitch: float, reach: float, angle: float | None = None
) -> CellGrating:
    """Draw a grating for an image that reaches ``reach`` (m) to each side of the middle.

    The ``angle`` (rad) is within 8 degrees where it is not given.
    """
    turned = np.deg2rad(rng.uniform(-8.0, 8.0))
    depth = 20e-9 * 25.0 ** rng.random()
    heights, widths = _cells(rng)
    return CellGrating(
        kind=kind,
        pitch=pitch,
        depth=depth,
        edge=pitch * rng.uniform(0.03, 0.12),
        width=0.5 if kind == "chessboard" else rng.uniform(0.4, 0.65),
        angle=turned if angle is None else angle,
        origin=(float(pitch * rng.uniform(-0.5, 0.5)), float(pitch * rng.uniform(-0.5, 0.5))),
        heights=heights,
        widths=widths,
        dust=_dust(rng, pitch, depth, reach),
        tilt=(float(rng.uniform(-5e-3, 5e-3)), float(rng.uniform(-5e-3, 5e-3))),
    )


def _cells(rng: np.random.Generator) -> tuple[Array, Array]:
    """Up to 4 % of the cells missing, and up to 6 % lower and of less steep edges."""
    shape = (TABLE, TABLE)
    missing = rng.random(shape) < rng.uniform(0.0, 0.04)
    damaged = rng.random(shape) < rng.uniform(0.0, 0.06)
    heights = np.where(damaged, rng.uniform(0.2, 0.9, shape), 1.0) * ~missing
    widths = np.where(damaged, rng.uniform(0.4, 1.0, shape), 1.0)
    return heights, widths


def _dust(rng: np.random.Generator, pitch: float, depth: float, reach: float) -> Particles:
    count = int(rng.integers(0, 31))
    x, y = rng.uniform(-reach, reach, (2, count))
    radius = pitch * 0.02 * 12.0 ** rng.random(count)
    return Particles(x, y, radius, depth * 0.2 * 20.0 ** rng.random(count))
