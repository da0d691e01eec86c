"""Mechanisms of the ferroelectric material."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from attrs import evolve, frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import AxisSpec, PlayBank, RationalSpec, quantity
from afm_scan_ros.simulation.mechanisms.base import Alteration, Blocks


@frozen(eq=False)
class DraggedBank(ABC):
    """Plays of a hysteresis that lag behind; at low speed they are the plays without a mechanism.

    State: the plays' positions, V, shape (elements,).
    """

    plays: PlayBank

    @abstractmethod
    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and all blocks, V, in each step of a field (n,); moves ``positions``."""

    def relaxed(self) -> Array:
        """State of a virgin scanner."""
        return self.plays.relaxed()

    def apply(self, positions: Array, drive: Array) -> tuple[Array, Array]:
        """Mean effective input F (V) in each step of drive (V), both of shape (n,)."""
        positions = positions.copy()
        total = self.dragged(self.plays.field(drive), positions)
        return positions, self.plays.effective(total)


@frozen(kw_only=True)
class ViscousBlocks(Blocks):
    """Hysteresis with a viscous film: each play has the sliding block of a Maxwell slip element.

        tau dp_r/dt = v - p_r - r    where v - p_r > r    (the block is pulled forwards)
                      v - p_r + r    where v - p_r < -r   (backwards)
                      0              between

    A dashpot acts on the block. At low speed each block follows its play; the faster the scan, the
    wider the loop. Exact while the drive is held. ``time_constant`` tau in s: viscosity of the film
    over the stiffness of the spring.
    """

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


@frozen(kw_only=True)
class LostPoling(Alteration):
    """A piezo that has lost some of its poling: less displacement for the same field.

        d' = (1 - loss) d

    ``loss``: share of the displacement that is lost.
    """

    KIND: ClassVar[str] = "lost_poling"

    loss: float = quantity(lt(1.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move less; the further modes' peaks are shares of the first and fall with it."""
        whole = axis.vibration
        numerator = tuple((1.0 - self.loss) * each for each in whole.numerator)
        return evolve(axis, vibration=RationalSpec(numerator, whole.denominator))
