"""A sensor whose gain fades while it warms up: what it reads shrinks with time.

x_read = x (1 - loss (1 - exp(-t / settling)))
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class FadingGain(Clocked):
    """``loss`` of the gain in the end, ``settling`` time (s)."""

    KIND: ClassVar[str] = "fading_gain"
    PLACE: ClassVar[Place] = "displacement"

    loss: float = quantity()
    settling: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: it has just been turned on."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) as it is read."""
        return own * (1.0 + self.loss * np.expm1(-time / self.settling))
