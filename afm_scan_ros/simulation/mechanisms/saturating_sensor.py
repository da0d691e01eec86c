"""A sensor whose reading flattens towards the ends of its range, as an LVDT's or a gauge's bridge.

x_read = reach arctan((x - offset) / reach), less what it reads at x = 0, over its slope there
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SaturatingSensor(Insert):
    """``reach`` (m) of the arctangent, ``offset`` (m) of its middle; there is no state."""

    KIND: ClassVar[str] = "saturating_sensor"
    PLACE: ClassVar[Place] = "displacement"

    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    offset: float = quantity(suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        middle = self.offset / self.reach
        flat = np.arctan(own / self.reach - middle) + np.arctan(middle)
        return None, self.reach * (1.0 + middle**2) * flat
