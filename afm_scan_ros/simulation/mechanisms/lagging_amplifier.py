"""An amplifier that charges the piezo through a resistance.

    R C dv/dt = u - v

The piezo's capacitance takes its time; the exponential is exact while the converter holds u.
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
class LaggingAmplifier(Insert):
    """``resistance`` in Ohm, ``capacitance`` in F; state: voltage across the piezo, V."""

    KIND: ClassVar[str] = "lagging_amplifier"
    PLACE: ClassVar[Place] = "drive"

    resistance: float = quantity(gt(0.0), suffix="_ohm")
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return _charge(state, own, step / (self.resistance * self.capacitance))


@compiled
def _charge(voltage: float, drive: Array, steps: float) -> tuple[float, Array]:
    done = -np.expm1(-steps)
    mean = np.empty_like(drive)
    for k in range(drive.size):
        missing = drive[k] - voltage
        mean[k] = drive[k] - missing * done / steps
        voltage += done * missing
    return voltage, mean
