"""An amplifier whose current fades out before its limit: transistors that go into saturation.

    C dv/dt = I tanh((u - v) / (R I))

Integrated in closed form while the converter holds u: sinh of the missing voltage falls off as an
exponential.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.charging import Charging
from afm_scan_ros.simulation.quantity import quantity

LARGE = 20.0  # whose sinh is half its exponential


@frozen(kw_only=True)
class TiredAmplifier(Charging):
    """``current`` in A; the capacitance is the piezo's."""

    KIND: ClassVar[str] = "tired_amplifier"

    current: float = quantity(gt(0.0), suffix="_ua", scale=1e-6)

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Voltage (V) across the piezo, mean of both ends of each step."""
        kept = float(np.exp(-step / self.constant))
        return _charge(state, own, self.resistance * self.current, kept)


@compiled
def _charge(voltage: float, drive: Array, knee: float, kept: float) -> tuple[float, Array]:
    mean = np.empty_like(drive)
    for k in range(drive.size):
        missing = (drive[k] - voltage) / knee
        size = abs(missing)
        if size < LARGE:
            left = np.arcsinh(kept * np.sinh(size))
        else:
            logarithm = size + np.log(kept)
            left = logarithm if logarithm > LARGE else np.arcsinh(0.5 * np.exp(logarithm))
        after = drive[k] - np.sign(missing) * knee * left
        mean[k] = 0.5 * (voltage + after)
        voltage = after
    return voltage, mean
