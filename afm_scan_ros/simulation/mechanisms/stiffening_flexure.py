"""A flexure that stiffens as it is stretched: beams held at both ends.

    x_out (1 + (x_out / length)^2) = x

A deflected beam must become longer, and the tension this takes adds a stiffness that grows with
the square of the deflection. The force is that of the unstretched flexure at x; the cubic is
solved in closed form.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class StiffeningFlexure(Insert):
    """``length`` (m): deflection at which the flexure is twice as stiff; there is no state."""

    KIND: ClassVar[str] = "stiffening_flexure"
    PLACE: ClassVar[Place] = "displacement"

    length: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) at which the stiffened flexure is in balance."""
        unit = 2.0 * self.length / np.sqrt(3.0)
        return None, unit * np.sinh(np.arcsinh(3.0 * own / unit) / 3.0)
