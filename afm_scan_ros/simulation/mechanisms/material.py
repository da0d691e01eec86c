"""Mechanisms of the material: creep and hysteresis of the piezo, and creep of a sample's mount."""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import deep_iterable, ge, gt, lt, min_len

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import (
    AxisSpec,
    PlayBank,
    RationalSpec,
    quantity,
    series,
    with_series,
)
from afm_scan_ros.simulation.mechanisms.base import Alteration, Blocks, Insert


@frozen(kw_only=True)
class CreepingMount(Insert):
    """A mount that creeps under the sample: springs and dashpots in series with the scanner.

        tau_i dz_i/dt = x - z_i
        x_out = x + share sum_i z_i

    Elements with time constants in geometric progression creep with the logarithm of time, as glue
    and clamped joints do. Exact for a motion that is linear within a step. ``share`` is the part of
    the displacement by which each element creeps, ``taus`` are the time constants, s.

    State: the elements' elongations z (m), shape (elements,), and the last displacement, m.
    """

    KIND: ClassVar[str] = "creeping_mount"

    share: float = quantity()
    taus: tuple[float, ...] = field(
        validator=[min_len(1), deep_iterable(gt(0.0))], metadata={"suffix": "_s", "scale": 1.0}
    )

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[Array, float]:  # noqa: ARG002
        """Nothing has crept."""
        return np.zeros(len(self.taus)), 0.0

    def act(
        self,
        state: tuple[Array, float],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[Array, float], Array]:
        """Displacement (m) with what has crept."""
        elements, last = state[0].copy(), state[1]
        crept = _creep(own, last, elements, step / np.array(self.taus))
        return (elements, float(own[-1])), own + self.share * crept


@compiled
def _creep(displacement: Array, last: float, elements: Array, steps: Array) -> Array:
    done = -np.expm1(-steps)
    crept = np.empty_like(displacement)
    for k in range(displacement.size):
        middle = 0.5 * (last + displacement[k])
        last = displacement[k]
        for i in range(elements.size):
            elements[i] += done[i] * (middle - elements[i])
        crept[k] = elements.sum()
    return crept


@frozen(kw_only=True)
class AgedCreep(Alteration):
    """A piezo whose creep has changed with age.

        g' = factor g

    ``factor`` multiplies the gain of every element of the creep; the time constants stay.
    """

    KIND: ClassVar[str] = "aged_creep"

    factor: float = quantity(ge(0.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Creep further by the factor, as fast."""
        gains, taus = series(axis.creep)
        return evolve(axis, creep=with_series(axis.creep, self.factor * gains, taus))


@frozen(eq=False)
class DraggedBank(ABC):
    """Plays of a hysteresis that lag behind, as fast as the drive is; state: their positions, V."""

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
