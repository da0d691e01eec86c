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
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SupplyRipple(Insert):
    """``amplitude`` (V) of the rectified sine, its ``frequency`` f (Hz).

    State: elapsed steps, and the phase (rad).
    """

    KIND: ClassVar[str] = "supply_ripple"
    PLACE: ClassVar[Place] = "drive"

    amplitude: float = quantity(suffix="_v")
    frequency: float = quantity(gt(0.0), suffix="_hz")

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, float]:  # noqa: ARG002
        """It hums already, in what phase is chance."""
        return 0, float(rng.uniform(0.0, np.pi))

    def act(
        self,
        state: tuple[int, float],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, float], Array]:
        """Drive (V) with the ripple, at the middle of each step."""
        elapsed, phase = state
        time = step * (np.arange(elapsed, elapsed + own.size) + 0.5)
        ripple = np.abs(np.sin(np.pi * self.frequency * time + phase)) - 2.0 / np.pi
        return (elapsed + own.size, phase), own + self.amplitude * ripple
