"""Registered images of a grating: positions and figures of each, and both directions compared.

A figure is scale, nonlinearity, loop or angle, with a 95 % interval from draws of the motion's
coefficients by their covariance. Images upwards and downwards show what the slow axis does by
itself and what drifts with time. Per metre commanded, drift adds to the motion of one direction
what it takes from the other. What they have in common is the scanner's: its scale, with creep and
hysteresis, and its angle.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.models import Positions, positions_of
from afm_scan_ros.features.images.grating.motion import middles
from afm_scan_ros.features.images.grating.registration import Registration, register
from afm_scan_ros.features.images.scan_image import ScanImage

DRAWS = 200
"""Draws of the coefficients, of which an interval leaves out five at either end."""
ENDS = (0.025, 0.975)
MOST = 0.95
WIDTH = 2.0
"""Uncertainty of 95 % certainty over a standard one."""
PERCENT = 100.0
MICRO, NANO = 1e6, 1e9
ROUNDING = 1e-12
"""Share of the covariance's trace that keeps it positive definite."""

Interval: TypeAlias = tuple[float, float, float]
"""Value, and the ends of its 95 % interval."""


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
class RegisteredImage:
    """An image, where the tip was at each of its pixels, and what that shows of the scanner."""

    image: ScanImage
    positions: Positions
    figures: tuple[ImageQuantity, ...]


def register_image(image: ScanImage, pitch: float) -> RegisteredImage:
    """Register trace and retrace of an image of a grating of a ``pitch`` (m).

    Raises InputError where there is no retrace or no such grating, ScanError where the turns do not
    settle.
    """
    found = register(image, pitch)
    positions = positions_of(found, upward=image.upward)
    return RegisteredImage(image, positions, figures_of(image, found, positions.known))


def accurate_ones(
    seen: Sequence[RegisteredImage], accuracy: float
) -> tuple[list[RegisteredImage], list[InputError]]:
    """Return images that show the pitch to an accuracy (1), and errors of the others.

    One at least must with 95 % certainty, in x and y. Beside it the standard uncertainty of others
    counts, half of that; in y only where they are as large, as smaller ones show x alone.
    """
    asked = PERCENT * accuracy
    sizes = [each.image.range_y for each in seen if pitch_uncertainty(each, "xy") <= asked]
    used: list[RegisteredImage] = []
    errors = []
    for each in seen:
        axes = "x" if sizes and each.image.range_y < max(sizes) else "xy"
        known = pitch_uncertainty(each, axes)
        if known <= (WIDTH if sizes else 1.0) * asked:
            used.append(each)
        else:
            errors.append(
                InputError(
                    f"{each.image.name}: the distance of a pitch is known to {known:.2g} % rms over"
                    f" the image (95 %), and {asked:.2g} % is asked: record an image that shows"
                    " more cells, with more pixels or less noise, or allow a lower accuracy"
                )
            )
    return used, errors


def pitch_uncertainty(seen: RegisteredImage, axes: str) -> float:
    """Uncertainty of the pitch of the axes, %, with 95 % certainty."""
    return max(f.value for f in seen.figures if f.name == PITCH and f.axis in axes)


def both_directions(seen: Sequence[RegisteredImage]) -> tuple[ImageQuantity, ...]:
    """Scale and angle of y without drift, and drift of x and y; none where a direction is missing.

    Of each direction the largest image counts. Drift is taken to be the same in both.
    """
    up, down = (
        max((e for e in seen if e.image.upward == way), key=lambda e: e.image.range_y, default=None)
        for way in (True, False)
    )
    if up is None or down is None:
        return ()
    (scale, change), (angle, slant) = (
        _halves(up, down, name) for name in ("scale", "angle to a right one")
    )
    images = up.image, down.image
    speeds = [each.range_y / (each.lines * (each.line_time or np.inf)) for each in images]
    metres = float(np.mean(speeds)) * NANO
    across = (metres * float(np.tan(np.radians(each))) for each in slant)
    return (
        ImageQuantity("scale without drift", "y", "1", *scale),
        ImageQuantity("angle without drift", "y", "°", *angle),
        ImageQuantity("drift", "y", "nm/s", *(metres * each for each in change)),
        ImageQuantity("drift", "x", "nm/s", *across),
    )


def _halves(up: RegisteredImage, down: RegisteredImage, name: str) -> tuple[Interval, Interval]:
    """Half the sum and half the difference of a figure of y, upwards and downwards."""
    one, other = (
        next(each for each in seen.figures if (each.axis, each.name) == ("y", name))
        for seen in (up, down)
    )
    width, wide = (0.5 * (each.upper - each.lower) for each in (one, other))
    half = 0.5 * float(np.hypot(width, wide))
    common, apart = 0.5 * (one.value + other.value), 0.5 * (one.value - other.value)
    return (common, common - half, common + half), (apart, apart - half, apart + half)


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
    Before them comes the distance of neighbouring cells: on a chessboard the pitch may be another.
    """
    seen = _motion(image, registration, known, registration.coefficients[np.newaxis])
    drawn = _motion(image, registration, known, _draws(registration))
    found = [
        ImageQuantity(
            name, axis, unit, float(rule(seen)[0]), *map(float, np.quantile(rule(drawn), ENDS))
        )
        for name, axis, unit, rule in RULES
    ]
    cells = MICRO * registration.pitch
    found.append(ImageQuantity("distance of neighbouring cells", "x", "µm", cells, cells, cells))
    for axis, moved in (("x", drawn.trace[..., 0]), ("y", drawn.rows[..., 1])):
        uncertain = _pitch_error(moved, registration.pitch)
        found.append(ImageQuantity(PITCH, axis, "% rms", uncertain, uncertain, uncertain))
    return tuple(found)


def _pitch_error(moved: Array, pitch: float) -> float:
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
    lines = form.across(middles(form.lines)[known])
    trace, retrace = (
        form.along(direction, middles(form.pixels)) @ coefficients[:, form.part(direction)]
        for direction in (0, 1)
    )
    rows = lines @ coefficients[:, 2 * form.fast : -1]
    along = (trace[:, -1] - trace[:, 0] + retrace[:, -1] - retrace[:, 0])[..., np.newaxis]
    cosine, sine = np.swapaxes(along / np.linalg.norm(along, axis=1, keepdims=True), 0, 1)
    turn = np.stack([np.hstack([cosine, -sine]), np.hstack([sine, cosine])], axis=1)
    there, back, up = (registration.pitch * each @ turn for each in (trace, retrace, rows))
    x = 0.5 * image.range_x * middles(image.pixels)
    y = 0.5 * image.range_y * middles(image.lines)
    return _Motion(there, back, up, x, y[known])
