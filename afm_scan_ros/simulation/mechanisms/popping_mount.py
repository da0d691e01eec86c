"""A mount that pops from one rest to another and back: a random telegraph.

    x_out = x + jump s,    s = 0 or 1, which changes with probability dt / dwell

Glue that cracks, a wire that touches, a charge in the sensor.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

POPS = 100_000


@frozen(kw_only=True)
class PoppingMount(Clocked):
    """``jump`` (m), mean ``dwell`` (s) at each rest."""

    KIND: ClassVar[str] = "popping_mount"
    PLACE: ClassVar[Place] = "displacement"

    jump: float = quantity(suffix="_nm", scale=1e-9)
    dwell: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> Array:
        """When it pops (s), for a long while; it begins at one rest."""
        return np.cumsum(rng.exponential(self.dwell, POPS))

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) with the jumps so far."""
        if time[-1] > drawn[-1]:
            raise InputError(f"popping_mount: the scan outlasts {POPS} pops: make dwell_s longer")
        return own + self.jump * (np.searchsorted(drawn, time, side="right") % 2)
