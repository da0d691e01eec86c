"""A grid plate whose two-dimensional encoder passes a scratch askew.

    x_read = x + depth (e^(-(across / SPOT)^2 / 2), less what it is at rest),
    across = x cos ANGLE + y sin ANGLE - OFFSET

Within the scratch the light comes back with another phase, weighed by the light of the spot that
falls on it, a Gaussian: a reading that is off where the scratch is, and right beside it. Each line
meets it elsewhere, so that it is neither a function of x, nor one of y, nor of time, nor a sum of
such: a fault of a place in the plane, which no effect of the catalogue has.
Source: W. Gao, Precision Nanometrology, Springer 2010 (surface encoders).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

ANGLE = np.radians(40.0)  # of the scratch's normal to the axis
OFFSET, SPOT = 5e-6, 2e-6  # m, of the scratch from where the scanner rests, and of the light


@frozen(kw_only=True)
class ScratchedPlate(Insert):
    """``depth`` (m) by which the reading is off in the middle of the scratch; there is no state."""

    KIND: ClassVar[str] = "scratched_plate"
    PLACE: ClassVar[Place] = "displacement"

    depth: float = quantity(suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        across = own * np.cos(ANGLE) + other * np.sin(ANGLE) - OFFSET
        return None, own + self.depth * (_light(across) - _light(-OFFSET))


def _light(across: Array | float) -> Array:
    """Share of the spot's light at its middle, so far from it (m)."""
    return np.asarray(np.exp(-0.5 * (across / SPOT) ** 2))
