"""An amplifier of two stages: an input filter, and an output that charges the piezo.

    tau_1 dw/dt = u - w
    tau_2 dv/dt = w - v

Exact while the converter holds u.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class BufferedAmplifier(Insert):
    """``slower`` time constant in s; the other is ``ratio`` times that. State: w and v, V."""

    KIND: ClassVar[str] = "buffered_amplifier"
    PLACE: ClassVar[Place] = "drive"

    slower: float = quantity(gt(0.0), suffix="_us", scale=1e-6)
    ratio: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Discharged."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        state = state.copy()
        return state, _charge(state, own, step, self.ratio * self.slower, self.slower)


@compiled
def _charge(state: Array, drive: Array, step: float, first: float, second: float) -> Array:
    """Two poles apart: v - u is a sum of two exponentials while u is held."""
    shares = first / (first - second), -second / (first - second)
    kept = np.exp(-step / first), np.exp(-step / second)
    means = (1.0 - kept[0]) * first / step, (1.0 - kept[1]) * second / step
    mean = np.empty_like(drive)
    for k in range(drive.size):
        behind, missing = state[0] - drive[k], state[1] - drive[k]
        fast = shares[0] * behind
        slow = missing - fast
        mean[k] = drive[k] + fast * means[0] + slow * means[1]
        state[0] = drive[k] + behind * kept[0]
        state[1] = drive[k] + fast * kept[0] + slow * kept[1]
    return mean
