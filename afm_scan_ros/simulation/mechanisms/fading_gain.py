"""A sensor whose gain fades while it warms up: what it reads shrinks with time.

x_read = x (1 - loss (1 - exp(-t / settling)))
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class FadingGain(Insert):
    """``loss`` of the gain in the end, ``settling`` time (s); state: elapsed steps."""

    KIND: ClassVar[str] = "fading_gain"
    PLACE: ClassVar[Place] = "displacement"

    loss: float = quantity()
    settling: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> int:  # noqa: ARG002
        """It has just been turned on."""
        return 0

    def act(self, state: int, own: Array, other: Array, step: float) -> tuple[int, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        time = step * np.arange(state, state + own.size)
        return state + own.size, own * (1.0 + self.loss * np.expm1(-time / self.settling))
