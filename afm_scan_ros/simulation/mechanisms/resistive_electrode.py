"""An electrode whose silver has thinned: the charge must diffuse along the tube.

    dv/ds = -r i,    di/ds = -c dv/dt,    v = u at one end, i = 0 at the other

A line of resistance and capacitance, not one of each: what lies near the wire follows at once, the
far end late. The tube's length adds up what every part does, so that the mean of v drives it, late
by resistance * capacitance / 3: an input lag. Solved by the line's first modes, exactly while
the converter holds u; the rest, 2 / (pi^2 TERMS) of all, follows at once.
Source: H. S. Carslaw and J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, 3.4.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

TERMS = 40
ROOTS = np.pi * (np.arange(TERMS, dtype=np.float64) + 0.5)


@frozen(kw_only=True)
class ResistiveElectrode(Insert):
    """``resistance`` (Ohm) from end to end, ``capacitance`` (F) of all; state: the modes, V."""

    KIND: ClassVar[str] = "resistive_electrode"
    PLACE: ClassVar[Place] = "drive"

    resistance: float = quantity(gt(0.0), suffix="_ohm")
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Discharged."""
        return np.zeros(TERMS)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Mean voltage (V) of the tube in each step."""
        modes = state.copy()
        steps = step / (self.resistance * self.capacitance) * ROOTS**2
        return modes, _diffuse(modes, own, steps, 2.0 / ROOTS**2)


@compiled
def _diffuse(modes: Array, drive: Array, steps: Array, shares: Array) -> Array:
    kept = np.exp(-steps)
    lasting = shares * (1.0 - kept) / steps
    mean = np.empty_like(drive)
    for k in range(drive.size):
        total = drive[k]
        for i in range(modes.size):
            behind = modes[i] - drive[k]
            total += lasting[i] * behind
            modes[i] = drive[k] + kept[i] * behind
        mean[k] = total
    return mean
