"""A heavier sample or holder on the scanner: its first resonance falls.

    w' = w / sqrt(1 + ratio),   d' = d / sqrt(1 + ratio)

Stiffness and dashpot of the mode stay what they were.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.simulation.detune import detuned_axis
from afm_scan_ros.simulation.mechanisms.base import Alteration
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import AxisSpec


@frozen(kw_only=True)
class HeavierLoad(Alteration):
    """``mass_ratio`` of what was added to the mass that moved before."""

    KIND: ClassVar[str] = "heavier_load"

    mass_ratio: float = quantity(gt(-0.9))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move the first resonance."""
        factor = float(1.0 / np.sqrt(1.0 + self.mass_ratio))
        return detuned_axis(axis, factor, factor)
