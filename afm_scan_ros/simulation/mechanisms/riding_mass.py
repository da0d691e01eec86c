"""A small mass on a leaf spring that rides on the scanner: a second bending mode.

    m q'' + c (q' - x') + k (q - x) = 0,    the scanner feels k (q - x) + c (q' - x')

Below its own resonance the mass makes the scanner heavier, near it the two exchange energy, and
far above it the scanner moves alone.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.simulation.mechanisms.attachment import Attachment, Stage
from afm_scan_ros.simulation.mechanisms.sprung_body import SprungBody
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class RidingMass(Attachment):
    """``mass_ratio`` to the moving mass, own ``frequency`` (Hz) and ``damping`` ratio."""

    KIND: ClassVar[str] = "riding_mass"

    mass_ratio: float = quantity(gt(0.0))
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def attached(self, stage: Stage) -> SprungBody:
        """Mass on the axis alone, its spring as stiff as mass and frequency make it."""
        natural = 2.0 * np.pi * self.frequency
        stiffness = self.mass_ratio * (natural / stage.natural) ** 2
        return SprungBody(self.row, stage, natural, self.damping, (1.0, 0.0), stiffness)
