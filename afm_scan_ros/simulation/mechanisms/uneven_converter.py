"""A sensor's converter of which one bit weighs too much: the reading jumps where it is set.

x_read = x + error b(x),    b = the bit of this weight in the number x / weight, rounded

Capacitors of a successive-approximation converter are matched to so many bits and no better: the
codes in between are missing, or come twice. The error is a square wave of x, of period 2 weight.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class UnevenConverter(Insert):
    """``weight`` (m) of the bit and its ``error`` (m); there is no state."""

    KIND: ClassVar[str] = "uneven_converter"
    PLACE: ClassVar[Place] = "displacement"

    weight: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    error: float = quantity(suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Reading (m) for a displacement (m)."""
        return None, own + self.error * np.mod(np.rint(own / self.weight), 2.0)
