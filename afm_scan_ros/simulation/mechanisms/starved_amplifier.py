"""An amplifier behind a converter that gives it no more than so much power.

    (C v^2 / 2)' <= power    while the piezo is charged, to either side;    v = u where that allows

A flyback converter hands over so many joules each second, at any voltage: what the piezo stores
grows no faster, and its voltage the less fast the higher it stands. A drive that runs outwards more
steeply is not followed until it comes back; back to zero the piezo is discharged as asked for. A
slew limit, of the way outwards alone. Exact while the converter holds u.
Source: R. W. Erickson, D. Maksimovic, Fundamentals of Power Electronics, 2001, 11 (power sources).
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
class StarvedAmplifier(Insert):
    """``power`` in W, the piezo's ``capacitance`` in F; state: its voltage, V."""

    KIND: ClassVar[str] = "starved_amplifier"
    PLACE: ClassVar[Place] = "drive"

    power: float = quantity(gt(0.0), suffix="_uw", scale=1e-6)
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return _charge(state, own, 2.0 * self.power * step / self.capacitance)


@compiled
def _charge(voltage: float, drive: Array, gained: float) -> tuple[float, Array]:
    """``gained``: by how much v^2 grows in a step at most, V^2."""
    mean = np.empty_like(drive)
    for k in range(drive.size):
        wanted = abs(drive[k])
        start = min(abs(voltage), wanted) if voltage * drive[k] > 0.0 else 0.0
        charging = min((wanted**2 - start**2) / gained, 1.0)  # share of the step
        end = np.sqrt(start**2 + charging * gained)
        if charging < 1.0:
            end = wanted
        area = 0.0
        if end > start:
            area = 2.0 / 3.0 * (start**2 + start * end + end**2) / (start + end) * charging
        mean[k] = np.sign(drive[k]) * (area + wanted * (1.0 - charging))
        voltage = np.sign(drive[k]) * end
    return voltage, mean
