"""An amplifier whose gain falls towards its rails: a differential pair without feedback.

    u_out = rail tanh(u / rail)

The current of two emitters that share one source. It bends the drive, before the hysteresis.
Source: P. R. Gray, R. G. Meyer, Analysis and Design of Analog Integrated Circuits, 3.5.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class CompressingAmplifier(Insert):
    """``rail`` in V, which the output never reaches; there is no state."""

    KIND: ClassVar[str] = "compressing_amplifier"
    PLACE: ClassVar[Place] = "drive"

    rail: float = quantity(gt(0.0), suffix="_v")

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Drive (V) as it comes out."""
        return None, self.rail * np.tanh(own / self.rail)
