"""An amplifier whose output stage gives no more than so much current into the piezo.

    C dv/dt = min(max((u - v) / R, -I), I)

Far from u the voltage runs in a straight line at I / C; within R I of it it closes in as an
exponential. Both are exact while the converter holds u.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.charging import Charging
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class LimitedAmplifier(Charging):
    """``current`` in A; the capacitance is the piezo's."""

    KIND: ClassVar[str] = "limited_amplifier"

    current: float = quantity(gt(0.0), suffix="_ua", scale=1e-6)

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        slew = self.current / self.capacitance
        return _charge(state, own, slew, self.constant, step)


@compiled
def _charge(
    voltage: float, drive: Array, slew: float, constant: float, step: float
) -> tuple[float, Array]:
    mean = np.empty_like(drive)
    for k in range(drive.size):
        missing = drive[k] - voltage
        straight = min(max(abs(missing) / slew - constant, 0.0), step)
        run = np.sign(missing) * slew * straight
        rest, left = step - straight, missing - run
        closed = -left * np.expm1(-rest / constant)
        area = (missing - 0.5 * run) * straight + constant * closed
        mean[k] = drive[k] - area / step
        voltage += run + closed
    return voltage, mean
