"""Images upwards and downwards → what the slow axis does by itself, and what drifts with time.

Per metre commanded, drift adds to the motion of one direction what it takes from the other. What
they have in common is the scanner's: its scale, with creep and hysteresis, and its angle.
"""

from collections.abc import Sequence

import numpy as np

from afm_scan_ros.core.imaging.grating.figures import NANO, Figure
from afm_scan_ros.core.imaging.grating.seen import Seen


def both_directions(seen: Sequence[Seen]) -> tuple[Figure, ...]:
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
        Figure("scale without drift", "y", "1", *_values(scale[0])),
        Figure("angle without drift", "y", "°", *_values(angle[0])),
        Figure("drift", "y", "nm/s", *(metres * each for each in _values(scale[1]))),
        Figure("drift", "x", "nm/s", *(metres * float(np.tan(each)) for each in across)),
    )


def largest(seen: Sequence[Seen]) -> Seen:
    """Return the image of the largest range in y."""
    return max(seen, key=lambda each: each.image.range_y)


def _largest(seen: Sequence[Seen], *, upward: bool) -> Seen | None:
    chosen = [each for each in seen if each.image.upward == upward]
    return largest(chosen) if chosen else None


def _speed(one: Seen) -> float:
    """Commanded speed of y, m/s."""
    return one.image.range_y / (one.image.lines * (one.image.line_time or np.inf))


def _halves(up: Seen, down: Seen, name: str) -> tuple[Figure, Figure]:
    """Half the sum and half the difference of a figure of y, upwards and downwards."""
    one, other = (
        next(each for each in seen.figures if (each.axis, each.name) == ("y", name))
        for seen in (up, down)
    )
    half = 0.5 * float(np.hypot(_half_width(one), _half_width(other)))
    sums = 0.5 * (one.value + other.value), 0.5 * (one.value - other.value)
    common, apart = (Figure(name, "y", one.unit, v, v - half, v + half) for v in sums)
    return common, apart


def _half_width(one: Figure) -> float:
    return 0.5 * (one.upper - one.lower)


def _values(one: Figure) -> tuple[float, float, float]:
    return one.value, one.lower, one.upper
