"""Blocks in a film that thins where it is sheared: twice the pull drags them four times as fast.

    dp_r/dt = e |e| / film,    e = the part of v - p_r beyond +-r

A grease flows by a power of its stress (Ostwald and de Waele), here by the square: at a steady
speed the blocks lag behind by its root, between a viscous film, where they lag in proportion, and
what heat helps along, by a logarithm. Slow loops are those of the healthy scanner, fast ones wider.
While the drive is held 1 / |e| grows by t / film, from which e and its mean follow exactly.
Source: R. B. Bird, R. C. Armstrong, O. Hassager, Dynamics of Polymeric Liquids, Wiley 1987, 4.1.
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
class ThinningBlocks(Blocks):
    """``film`` in V s: the square of a pull (V) over the speed (V/s) that it drags a block at."""

    KIND: ClassVar[str] = "thinning_blocks"

    film: float = quantity(gt(0.0), suffix="_uv_s", scale=1e-6)

    def bank(self, plays: PlayBank, step: float) -> "ThinningBank":
        """The hysteresis with the film, for a drive that is held for ``step`` s."""
        return ThinningBank(plays, step / self.film)


@frozen(eq=False)
class ThinningBank(DraggedBank):
    """The ``plays`` of a hysteresis; one over a pull grows by ``thinned`` (1/V) in a step."""

    thinned: float

    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and blocks, V, in each step; moves ``positions``."""
        plays = self.plays
        return _drag(field, plays.thresholds, plays.weights, positions, self.thinned)


@compiled
def _drag(
    field: Array, thresholds: Array, weights: Array, positions: Array, thinned: float
) -> Array:
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        total[k] = v
        for i in range(positions.size):
            target = min(max(positions[i], v - thresholds[i]), v + thresholds[i])
            pull = target - positions[i]
            steps = abs(pull) * thinned
            mean = np.sign(pull) * np.log1p(steps) / thinned
            positions[i] = target - pull / (1.0 + steps)
            total[k] += weights[i] * (target - mean)
    return total
