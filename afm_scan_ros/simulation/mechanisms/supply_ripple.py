"""A supply that hums into the amplifier: rectified mains on the drive.

    u_out = u + amplitude |sin(pi f t + phase)|, its mean removed

The drive's ripple has every multiple of f (twice the mains) and passes through hysteresis and
structure as the drive does.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SupplyRipple(Clocked):
    """``amplitude`` (V) of the rectified sine, its ``frequency`` f (Hz)."""

    KIND: ClassVar[str] = "supply_ripple"
    PLACE: ClassVar[Place] = "drive"

    amplitude: float = quantity(suffix="_v")
    frequency: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Phase (rad) of the sine: it hums already."""
        return float(rng.uniform(0.0, np.pi))

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Drive (V) with the ripple."""
        ripple = np.abs(np.sin(np.pi * self.frequency * time + drawn)) - 2.0 / np.pi
        return own + self.amplitude * ripple
