"""An arm that swings with the other axis: the tip runs on an arc.

x_out = x + y^2 / (2 radius)
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import in_, not_

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SwingingArm(Insert):
    """``radius`` of the arc, m, negative to the other side; there is no state."""

    KIND: ClassVar[str] = "swinging_arm"
    PLACE: ClassVar[Place] = "displacement"

    radius: float = quantity(
        not_(in_((0.0,)), msg="an arc of radius 0 is none"), suffix="_um", scale=1e-6
    )

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) on the arc."""
        return None, own + other**2 / (2.0 * self.radius)
