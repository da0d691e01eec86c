"""Blocks that do not slide at once: each play of the hysteresis is dragged through a viscous film.

    tau dp_r/dt = v - p_r - r    where v - p_r > r    (the block is pulled forwards)
                  v - p_r + r    where v - p_r < -r   (backwards)
                  0              between

A Maxwell slip element (spring and sliding block) with a dashpot at the block: quasi-statically the
play of the healthy scanner; the faster the scan, the further the blocks lag behind and the wider
the loop. Exact while the drive is held.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Blocks
from afm_scan_ros.simulation.mechanisms.dragged import DraggedBank
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class ViscousBlocks(Blocks):
    """``time_constant`` tau in s: viscosity of the film over the stiffness of the springs."""

    KIND: ClassVar[str] = "viscous_blocks"

    time_constant: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def bank(self, plays: PlayBank, step: float) -> "ViscousBank":
        """The hysteresis with the film, for a drive that is held for ``step`` s."""
        return ViscousBank(plays, step / self.time_constant)


@frozen(eq=False)
class ViscousBank(DraggedBank):
    """The ``plays`` of a hysteresis, dragged for ``steps`` time constants at a time."""

    steps: float

    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and blocks, V, in each step; moves ``positions``."""
        plays = self.plays
        return _drag(field, plays.thresholds, plays.weights, positions, self.steps)


@compiled
def _drag(field: Array, thresholds: Array, weights: Array, positions: Array, steps: float) -> Array:
    done = -np.expm1(-steps)
    lag = 1.0 - done / steps
    total, mean = np.empty_like(field), np.empty_like(positions)
    for k in range(field.size):
        v = field[k]
        for i in range(positions.size):
            target = min(max(positions[i], v - thresholds[i]), v + thresholds[i])
            pull = target - positions[i]
            mean[i] = positions[i] + lag * pull
            positions[i] += done * pull
        total[k] = v + np.dot(weights, mean)
    return total
