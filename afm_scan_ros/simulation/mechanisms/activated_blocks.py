"""Blocks that heat helps over their hills: they slip the faster the harder they are pulled.

    dp_r/dt = slip_speed sinh(e / activation),    e = the part of v - p_r beyond +-r

Eyring's law of activated flow. At a steady pull e grows as the logarithm of the speed, far less
than in a viscous film; where the pull is small against ``activation`` it is one. While the drive
is held tanh(e / 2 activation) falls off as an exponential, from which e follows exactly; its mean
over a step is taken by Simpson's rule. Source: H. Eyring, J. Chem. Phys. 4 (1936) 283.
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
class ActivatedBlocks(Blocks):
    """``activation`` in V, ``slip_speed`` in V/s."""

    KIND: ClassVar[str] = "activated_blocks"

    activation: float = quantity(gt(0.0), suffix="_mv", scale=1e-3)
    slip_speed: float = quantity(gt(0.0), suffix="_v_per_s")

    def bank(self, plays: PlayBank, step: float) -> "ActivatedBank":
        """The hysteresis with such blocks, for a drive that is held for ``step`` s."""
        half = 0.5 * step * self.slip_speed / self.activation
        return ActivatedBank(plays, 2.0 * self.activation, half)


@frozen(eq=False)
class ActivatedBank(DraggedBank):
    """The ``plays`` of a hysteresis; tanh of a pull over ``scale`` (V) decays by e in 1 / ``half``.

    ``half`` is half a step.
    """

    scale: float
    half: float

    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and blocks, V, in each step; moves ``positions``."""
        plays, law = self.plays, (self.scale, float(np.exp(-self.half)))
        return _drag(field, plays.thresholds, plays.weights, positions, law)


@compiled
def _drag(
    field: Array, thresholds: Array, weights: Array, positions: Array, law: tuple[float, float]
) -> Array:
    scale, kept = law
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        total[k] = v
        for i in range(positions.size):
            target = min(max(positions[i], v - thresholds[i]), v + thresholds[i])
            pull = target - positions[i]
            middle = after = 0.0
            if pull != 0.0:
                ahead = np.tanh(pull / scale)
                middle = scale * np.arctanh(kept * ahead)
                after = scale * np.arctanh(kept * kept * ahead)
            positions[i] = target - after
            total[k] += weights[i] * (target - (pull + 4.0 * middle + after) / 6.0)
    return total
