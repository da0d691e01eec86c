"""A scanner that swings: how far an angle takes the sample depends on where the other axis is.

    x_out = x (arm + y) / arm

A bending tube turns the sample about a point. The arm from there to the sample becomes longer as
the other axis moves out.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class ScannerBow(Insert):
    """``arm`` (m) while the other axis rests; there is no state."""

    KIND: ClassVar[str] = "scanner_bow"
    PLACE: ClassVar[Place] = "displacement"

    arm: float = quantity(ge(1e-4), suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) at the end of the arm."""
        return None, own * (1.0 + other / self.arm)
