"""An amplifier on one chip, whose output stage heats its input stage.

    v = u + offset h,    settling h' = P - h,    P = |u| (SUPPLY - |u|) / (SUPPLY / 2)^2

The transistor that drives the load takes what is left of the supply: nothing at zero nor at the
rail, most half-way. Its heat crosses the chip within ``settling`` and makes the two transistors of
the input unequal, which by 2 mV/K offsets the drive: not by where it is, but by where it has just
been, on either side of zero alike. A bend with a memory, which vanishes at high rates and is even
where what creeps is odd: no effect of the catalogue. Exact while the converter holds u.
Source: J. E. Solomon, IEEE J. Solid-State Circuits 9 (1974) 314 (thermal feedback).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.mechanisms.first_order import follow
from afm_scan_ros.simulation.quantity import quantity

SUPPLY = 15.0  # V, to either side of zero


@frozen(kw_only=True)
class SelfHeatingAmplifier(Insert):
    """``offset`` (V) after a long while at half the supply, ``settling`` (s); state: h."""

    KIND: ClassVar[str] = "self_heating_amplifier"
    PLACE: ClassVar[Place] = "drive"

    offset: float = quantity(suffix="_mv", scale=1e-3)
    settling: float = quantity(gt(0.0), suffix="_ms", scale=1e-3)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """No load, no heat."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        power = np.abs(own) * (SUPPLY - np.abs(own)) / (0.5 * SUPPLY) ** 2
        state, warmth = follow(state, power, step / self.settling)
        return state, own + self.offset * warmth
