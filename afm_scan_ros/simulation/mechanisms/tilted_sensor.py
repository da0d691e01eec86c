"""A sensor mounted askew: its axis is not the scanner's.

x_read = x cos(angle) + y sin(angle)
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, le

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class TiltedSensor(Insert):
    """``angle`` in rad from the axis towards the other one; there is no state."""

    KIND: ClassVar[str] = "tilted_sensor"
    PLACE: ClassVar[Place] = "displacement"

    angle: float = quantity(ge(-0.5), le(0.5), suffix="_mrad", scale=1e-3)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) along the sensor's axis."""
        return None, np.cos(self.angle) * own + np.sin(self.angle) * other
