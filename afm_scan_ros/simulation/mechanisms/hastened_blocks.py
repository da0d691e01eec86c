"""Blocks that stick the harder the faster they are pulled: thresholds that grow with the speed.

    r_i' = r_i (1 + hardening |dv/dt|),    p_i <- min(max(p_i, v - r_i'), v + r_i')

The rate-dependent Prandtl-Ishlinskii operator: the healthy scanner's where the drive is slow; the
faster the scan, the wider the loop. Source: M. Al Janaideh, S. Rakheja, C.-Y. Su, Smart Mater.
Struct. 18 (2009) 045018.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Blocks
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.quantity import quantity

ROUNDING = 80e-6
"""s; in which the amplifier rounds the converter's steps, which have no speed."""


@frozen(kw_only=True)
class HastenedBlocks(Blocks):
    """``hardening`` in s/V: by what share a volt a second raises every threshold."""

    KIND: ClassVar[str] = "hastened_blocks"

    hardening: float = quantity(ge(0.0), suffix="_us_per_v", scale=1e-6)

    def bank(self, plays: PlayBank, step: float) -> "HastenedBank":
        """The hysteresis with these thresholds, for a drive that is held for ``step`` s."""
        return HastenedBank(plays, self.hardening, step)


@frozen(eq=False)
class HastenedBank:
    """The ``plays`` of a hysteresis with thresholds that a speed raises by ``hardening`` (s/V).

    State: the blocks' positions and the last field, V, and its rounded speed, V/s; shape
    (elements + 2,).
    """

    plays: PlayBank
    hardening: float
    step: float

    def relaxed(self) -> Array:
        """State of a virgin scanner."""
        return np.concatenate((self.plays.relaxed(), np.zeros(2)))

    def apply(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Effective input F (V) of drive (V), both of shape (n,)."""
        state, plays = state.copy(), self.plays
        film = (self.hardening, self.step)
        total = _drag(plays.field(drive), plays.thresholds, plays.weights, state, film)
        return state, plays.effective(total)


@compiled
def _drag(
    field: Array, thresholds: Array, weights: Array, state: Array, film: tuple[float, float]
) -> Array:
    hardening, step = film
    kept = np.exp(-step / ROUNDING)
    count = thresholds.size
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        speed = state[count + 1] + (v - state[count]) / ROUNDING
        state[count], state[count + 1] = v, kept * speed
        total[k] = v
        for rate in (speed, kept * speed):  # at both ends of the step
            for i in range(count):
                reach = thresholds[i] * (1.0 + hardening * abs(rate))
                state[i] = min(max(state[i], v - reach), v + reach)
                total[k] += 0.5 * weights[i] * state[i]
    return total
