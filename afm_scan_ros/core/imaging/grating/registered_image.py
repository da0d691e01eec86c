"""Registered images of a grating: positions and figures of each, and both directions compared.

Images upwards and downwards show what the slow axis does by itself and what drifts with time. Per
metre commanded, drift adds to the motion of one direction what it takes from the other. What they
have in common is the scanner's: its scale, with creep and hysteresis, and its angle.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.grating.figures import NANO, ImageQuantity, figures_of
from afm_scan_ros.core.imaging.grating.models import Positions, positions_of
from afm_scan_ros.core.imaging.grating.registration import register
from afm_scan_ros.core.imaging.scan_image import ScanImage


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
    if image.retrace is None:
        raise InputError(f"{image.name}: holds no retrace: give an image of both directions")
    found = register(image, pitch)
    positions = positions_of(found, 2, upward=image.upward)
    return RegisteredImage(image, positions, figures_of(image, found, positions.known))


def both_directions(seen: Sequence[RegisteredImage]) -> tuple[ImageQuantity, ...]:
    """Scale and angle of y without drift, and drift of x and y; none where a direction is missing.

    Of each direction the largest image counts. Drift is taken to be the same in both.
    """
    up, down = (_largest(seen, upward=upward) for upward in (True, False))
    if up is None or down is None:
        return ()
    scale = _halves(up, down, "scale")
    angle = _halves(up, down, "angle to a right one")
    speed = _speed(up), _speed(down)
    metres = float(np.mean(speed)) * NANO
    across = np.radians(angle[1].value), np.radians(angle[1].lower), np.radians(angle[1].upper)
    return (
        ImageQuantity("scale without drift", "y", "1", *_values(scale[0])),
        ImageQuantity("angle without drift", "y", "°", *_values(angle[0])),
        ImageQuantity("drift", "y", "nm/s", *(metres * each for each in _values(scale[1]))),
        ImageQuantity("drift", "x", "nm/s", *(metres * float(np.tan(each)) for each in across)),
    )


def largest(seen: Sequence[RegisteredImage]) -> RegisteredImage:
    """Return the image of the largest range in y."""
    return max(seen, key=lambda each: each.image.range_y)


def _largest(seen: Sequence[RegisteredImage], *, upward: bool) -> RegisteredImage | None:
    chosen = [each for each in seen if each.image.upward == upward]
    return largest(chosen) if chosen else None


def _speed(one: RegisteredImage) -> float:
    """Commanded speed of y, m/s."""
    return one.image.range_y / (one.image.lines * (one.image.line_time or np.inf))


def _halves(
    up: RegisteredImage, down: RegisteredImage, name: str
) -> tuple[ImageQuantity, ImageQuantity]:
    """Half the sum and half the difference of a figure of y, upwards and downwards."""
    one, other = (
        next(each for each in seen.figures if (each.axis, each.name) == ("y", name))
        for seen in (up, down)
    )
    half = 0.5 * float(np.hypot(_half_width(one), _half_width(other)))
    sums = 0.5 * (one.value + other.value), 0.5 * (one.value - other.value)
    common, apart = (ImageQuantity(name, "y", one.unit, v, v - half, v + half) for v in sums)
    return common, apart


def _half_width(one: ImageQuantity) -> float:
    return 0.5 * (one.upper - one.lower)


def _values(one: ImageQuantity) -> tuple[float, float, float]:
    return one.value, one.lower, one.upper
