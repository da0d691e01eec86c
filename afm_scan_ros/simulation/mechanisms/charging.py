"""What charges a capacitance through a resistance; how fast, each file says."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class Charging(Insert):
    """``resistance`` in Ohm, ``capacitance`` in F; state: the voltage that it is charged to, V."""

    PLACE: ClassVar[Place] = "drive"

    resistance: float = quantity(gt(0.0), suffix="_ohm")
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    @property
    def constant(self) -> float:
        """Time constant, s."""
        return self.resistance * self.capacitance

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0
