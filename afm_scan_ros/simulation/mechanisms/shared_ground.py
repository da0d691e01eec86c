"""A ground that both amplifiers share: the other axis' charging current lifts this one's zero.

    u_out = u + share p,    time_constant dp/dt = u_other - p

It acts on the drive, before this axis' own hysteresis. Exact while the converter holds u_other.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SharedGround(Insert):
    """``share`` (1) that is picked up, after a lag of ``time_constant`` (s); state: its part, V."""

    KIND: ClassVar[str] = "shared_ground"
    PLACE: ClassVar[Place] = "drive"

    share: float = quantity()
    time_constant: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Nothing is picked up."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:
        """Drive (V) with what is picked up."""
        picked = _lag(state, other, float(np.exp(-step / self.time_constant)))
        return float(picked[-1]), own + self.share * picked


@compiled
def _lag(voltage: float, drive: Array, kept: float) -> Array:
    picked = np.empty_like(drive)
    for k in range(drive.size):
        voltage = drive[k] + kept * (voltage - drive[k])
        picked[k] = voltage
    return picked
