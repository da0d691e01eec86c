"""A single-ended high-voltage amplifier: a transistor that pushes, a resistor that pulls.

    v = u                                where u rises
    capacitance v' = -(v + SUPPLY) / pull    until v = u, where it falls

Up, the transistor gives what is asked. Down, the piezo discharges through the load resistor towards
the negative supply, the faster the higher it stands. A drive that falls more steeply is not
followed: a slew limit, of one direction and at another value for each voltage. Exact while the
converter holds u. Source: P. Horowitz and W. Hill, The Art of Electronics, 2015, 2.2.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

SUPPLY = 15.0  # V, below zero


@frozen(kw_only=True)
class SingleEndedAmplifier(Insert):
    """``pull`` in Ohm, ``capacitance`` in F; state: piezo's voltage, V."""

    KIND: ClassVar[str] = "single_ended_amplifier"
    PLACE: ClassVar[Place] = "drive"

    pull: float = quantity(gt(0.0), suffix="_kohm", scale=1e3)
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return _charge(state, own, step * self.rate, SUPPLY)

    @property
    def rate(self) -> float:
        """Rate of its discharge, 1/s."""
        return 1.0 / (self.pull * self.capacitance)


@compiled
def _charge(voltage: float, drive: Array, steps: float, supply: float) -> tuple[float, Array]:
    """``steps``: a step in time constants of the discharge, and so is ``falling``."""
    mean = np.empty_like(drive)
    for k in range(drive.size):
        above, falling = voltage + supply, 0.0
        if voltage > drive[k]:
            end = max(drive[k] + supply, above * np.exp(-steps))
            falling = min(np.log(above / end), steps)
            voltage = end - supply
        dropped = -above * np.expm1(-falling)
        mean[k] = (dropped - supply * falling + drive[k] * (steps - falling)) / steps
        voltage = max(voltage, drive[k])
    return voltage, mean
