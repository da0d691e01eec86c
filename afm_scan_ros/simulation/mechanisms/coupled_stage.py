"""A leg between the two axes: the other axis' motion pulls at this one, through the leg's mass.

    m q'' + c r' + k r = 0,  r = q - (x + y) / 2;    x feels k s + c s',  s = q - x / 2

Slowly, the axis moves by ``share`` of the other one's displacement; near the leg's own frequency
by more, and the axis feels the leg. The other axis is driven by the much stiffer of the two
stages: what it feels is neglected. The axis' stiffness, as stated, includes the leg's.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.simulation.mechanisms.attachment import Attachment, Stage
from afm_scan_ros.simulation.mechanisms.sprung_body import SprungBody
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class CoupledStage(Attachment):
    """``share`` of the other axis' displacement; the leg's ``frequency`` (Hz) and ``damping``."""

    KIND: ClassVar[str] = "coupled_stage"

    share: float = quantity()
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def attached(self, stage: Stage) -> SprungBody:
        """Leg, half on either axis."""
        natural = 2.0 * np.pi * self.frequency
        halves = (0.5, 0.5)
        return SprungBody(self.row, stage, natural, self.damping, halves, 2.0 * self.share)
