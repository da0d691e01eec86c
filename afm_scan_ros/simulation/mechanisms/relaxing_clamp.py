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
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class RelaxingClamp(Clocked):
    """``scale`` (m) of the logarithm, ``settling`` (s) after which it sets in."""

    KIND: ClassVar[str] = "relaxing_clamp"
    PLACE: ClassVar[Place] = "displacement"

    scale: float = quantity(suffix="_nm", scale=1e-9)
    settling: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: it has just been tightened."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the clamp."""
        return own + self.scale * np.log1p(time / self.settling)
