"""An optical sensor of which the two signals are unequal: an error that repeats with position.

    c = e^{i phi} + inequality e^{-i phi},   phi = 2 pi x / period
    reading: x where c = e^{i phi}

Sine and cosine of unequal amplitude (or not quite a quarter of a period apart) run on an ellipse
instead of a circle, and the electronics take its angle. The error repeats twice a period.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, lt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class CyclicEncoder(Insert):
    """``period`` (m) of the scale, ``inequality`` (1) of the signals; there is no state."""

    KIND: ClassVar[str] = "cyclic_encoder"
    PLACE: ClassVar[Place] = "displacement"

    period: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    inequality: float = quantity(ge(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Reading (m) for a displacement (m)."""
        turn = 2.0 * np.pi / self.period
        twice = 2.0 * turn * own
        ahead = np.arctan2(-self.inequality * np.sin(twice), 1.0 + self.inequality * np.cos(twice))
        return None, own + ahead / turn
