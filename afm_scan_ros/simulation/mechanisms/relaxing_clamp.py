"""A clamp that relaxes after it was tightened, and takes the sample along.

    dz/dt = scale / settling exp(-z / scale),    hence    z = scale ln(1 + t / settling)
    x_out = x + z

Dislocations that stress helps over their hills: the further the metal has given way, the harder
the next one is to move, so that it never comes to rest, but moves ever more slowly, as 1 / t.
Source: A. H. Cottrell, Dislocations and Plastic Flow in Crystals, Oxford 1953.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class RelaxingClamp(Insert):
    """``scale`` (m) of the logarithm, ``settling`` (s) after which it sets in.

    State: elapsed steps.
    """

    KIND: ClassVar[str] = "relaxing_clamp"
    PLACE: ClassVar[Place] = "displacement"

    scale: float = quantity(suffix="_nm", scale=1e-9)
    settling: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> int:  # noqa: ARG002
        """It has just been tightened."""
        return 0

    def act(self, state: int, own: Array, other: Array, step: float) -> tuple[int, Array]:  # noqa: ARG002
        """Displacement (m) carried along by the clamp."""
        time = step * np.arange(state, state + own.size)
        return state + own.size, own + self.scale * np.log1p(time / self.settling)
