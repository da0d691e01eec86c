"""What an image of a grating shows of the scanner: scale, nonlinearity, loop and angles.

Each figure has a 95 % interval, from draws of the motion's coefficients by their covariance.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np
from attrs import frozen

from afm_scan_ros.core.imaging.grating.motion import middles
from afm_scan_ros.core.imaging.grating.registration import Registration
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.types import Array

DRAWS = 200
"""Draws of the coefficients, of which an interval leaves out five at either end."""
ENDS = (0.025, 0.975)
MOST = 0.95
PERCENT = 100.0
NANO = 1e9
ROUNDING = 1e-12
"""Share of the covariance's trace that keeps it positive definite."""


@frozen
class ImageQuantity:
    """A quantity of an ``axis`` that an image shows: ``unit``, value and 95 % interval."""

    name: str
    axis: str
    unit: str
    value: float
    lower: float
    upper: float


@frozen(eq=False)
class _Motion:
    """Mean motion of an image, m: of columns and of lines, x and y in the last axis.

    ``trace`` and ``retrace`` are (..., pixels, 2), ``rows`` (..., lines, 2) of the known
    lines, commanded places ``x`` (pixels,) and ``y`` (lines,).
    """

    trace: Array
    retrace: Array
    rows: Array
    x: Array
    y: Array

    @property
    def columns(self) -> Array:
        return np.asarray(0.5 * (self.trace + self.retrace))


_Rule: TypeAlias = Callable[[_Motion], Array]


def _slope(values: Array, places: Array) -> Array:
    """Slope of values (..., n) against places (n,)."""
    from_middle = places - places.mean()
    return np.asarray(values @ from_middle / (from_middle @ from_middle))


def _bend(values: Array, places: Array) -> Array:
    """Rms of what a straight line leaves of values (..., n), % of the places' range."""
    line = _slope(values, places)[..., np.newaxis] * (places - places.mean())
    left = values - values.mean(axis=-1, keepdims=True) - line
    return np.asarray(PERCENT * left.std(axis=-1) / _range(places))


def _range(places: Array) -> float:
    return float(np.ptp(places)) * len(places) / (len(places) - 1)


def _sag(values: Array, places: Array) -> Array:
    """Height of the parabola in values (..., n) over its chord, % of the places' range."""
    curve = np.polynomial.polynomial.polyfit(places, values.reshape(-1, len(places)).T, 2)[2]
    sag = -curve * (0.5 * _range(places)) ** 2
    return np.asarray(PERCENT * sag.reshape(values.shape[:-1]) / _range(places))


PITCH = "uncertainty of the pitch"
RULES: Sequence[tuple[str, str, str, _Rule]] = (
    ("scale", "x", "1", lambda m: _slope(m.columns[..., 0], m.x)),
    ("nonlinearity", "x", "% rms", lambda m: _bend(m.columns[..., 0], m.x)),
    (
        "loop width",
        "x",
        "%",
        lambda m: PERCENT * np.abs(m.trace[..., 0] - m.retrace[..., 0]).max(axis=-1) / _range(m.x),
    ),
    ("bow of a line", "x", "%", lambda m: _sag(m.columns[..., 1], m.x)),
    ("scale", "y", "1", lambda m: _slope(m.rows[..., 1], m.y)),
    ("nonlinearity", "y", "% rms", lambda m: _bend(m.rows[..., 1], m.y)),
    (
        "angle to a right one",
        "y",
        "°",
        lambda m: np.degrees(np.arctan2(_slope(m.rows[..., 0], m.y), _slope(m.rows[..., 1], m.y))),
    ),
)
"""Name, axis, unit and rule of each figure."""


def figures_of(
    image: ScanImage, registration: Registration, known: slice
) -> tuple[ImageQuantity, ...]:
    """Figures of an image that was registered in trace and retrace; y counts in ``known`` lines.

    The last two are errors of the distance of a pitch, rms over the image, with 95 % certainty.
    """
    seen = _motion(image, registration, known, registration.coefficients[np.newaxis])
    drawn = _motion(image, registration, known, _draws(registration))
    found = [
        ImageQuantity(
            name, axis, unit, float(rule(seen)[0]), *map(float, np.quantile(rule(drawn), ENDS))
        )
        for name, axis, unit, rule in RULES
    ]
    for axis, moved in (("x", drawn.trace[..., 0]), ("y", drawn.rows[..., 1])):
        uncertain = _pitch_uncertainty(moved, registration.pitch)
        found.append(ImageQuantity(PITCH, axis, "% rms", uncertain, uncertain, uncertain))
    return tuple(found)


def _pitch_uncertainty(moved: Array, pitch: float) -> float:
    """Rms error of a distance of a pitch, %, that 95 % of draws of a motion (draws, n), m, keep."""
    count = moved.shape[1]
    spacing = abs(float(np.mean(moved[:, -1] - moved[:, 0]))) / (count - 1)
    apart = min(max(round(pitch / spacing), 1), count - 1)
    distances = (moved[:, apart:] - moved[:, :-apart]) / pitch
    errors = np.sqrt(np.mean((distances - distances.mean(axis=0)) ** 2, axis=1))
    return float(PERCENT * np.quantile(errors, MOST))


def _draws(registration: Registration) -> Array:
    """Coefficients (DRAWS, count, 2) as likely as their covariance says."""
    covariance = registration.covariance
    steady = covariance + ROUNDING * np.trace(covariance) * np.eye(len(covariance))
    normal = np.random.default_rng(0).standard_normal((DRAWS, len(covariance)))
    change = (normal @ np.linalg.cholesky(steady).T).reshape(DRAWS, 2, -1)
    return np.asarray(registration.coefficients + np.swapaxes(change, 1, 2))


def _motion(
    image: ScanImage, registration: Registration, known: slice, coefficients: Array
) -> _Motion:
    """Return the motion of coefficients (n, count, 2), x along the mean line."""
    form = registration.form
    pixels, lines = form.along(middles(form.pixels)), form.across(middles(form.lines)[known])
    trace, retrace = (
        pixels @ coefficients[:, first : first + form.fast] for first in (0, form.fast)
    )
    rows = lines @ coefficients[:, 2 * form.fast : -1]
    along = (trace[:, -1] - trace[:, 0] + retrace[:, -1] - retrace[:, 0])[..., np.newaxis]
    cosine, sine = np.swapaxes(along / np.linalg.norm(along, axis=1, keepdims=True), 0, 1)
    turn = np.stack([np.hstack([cosine, -sine]), np.hstack([sine, cosine])], axis=1)
    there, back, up = (registration.pitch * each @ turn for each in (trace, retrace, rows))
    x, y = (0.5 * span * middles(n) for span, n in _sides(image))
    return _Motion(there, back, up, x, y[known])


def _sides(image: ScanImage) -> Iterator[tuple[float, int]]:
    yield image.range_x, image.pixels
    yield image.range_y, image.lines
