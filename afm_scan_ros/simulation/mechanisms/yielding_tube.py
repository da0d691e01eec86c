"""A tube that gives way: the more it bends, the softer it is and the more it loses.

    s_i' = x' (1 - (s_i / reach_i)^2 [x' s_i > 0])
    f = -(share / n) sum_i s_i

Springs that yield, one after another as the elongation x grows (Bouc-Wen), stiffen the axis. Small
motions meet them all; large ones fewer, with a loss in each turn: the gain rises with the losses
and the resonance falls with the amplitude. The springs act in feedback on the elongation, inside
the resonance (see attachment.py). Source: Y.-K. Wen, J. Eng. Mech. 102 (1976) 249.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.giving_way import GivingWay, Parts


@frozen(eq=False)
class YieldingSprings(Parts):
    """Springs of ``share`` (1) altogether, with ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the springs are drawn and give way."""
        stage = (self.stage.natural, self.stage.damping)
        return _integrate(state, path[0], step, stage, self.share, self.reaches)


@frozen(kw_only=True)
class YieldingTube(GivingWay):
    """``share`` of the axis' stiffness that the springs add, and where they yield, m."""

    KIND: ClassVar[str] = "yielding_tube"
    PARTS: ClassVar[type[Parts]] = YieldingSprings


@compiled
def _integrate(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    u = np.empty(path.size - 1)
    slope, trial, total = np.zeros(state.size), np.zeros(state.size), np.zeros(state.size)
    for k in range(u.size):
        speed = (path[k + 1] - path[k]) / step
        slope[:] = 0.0
        total[:] = state
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            for i in range(state.size):
                trial[i] = state[i] + ahead * step * slope[i]
            _slopes(trial, speed, stage, share, reaches, slope)
            for i in range(state.size):
                total[i] += step / 6.0 * weight * slope[i]
        state[:] = total
        u[k] = state[0]
    return u


@compiled
def _slopes(
    state: Array,
    speed: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
    slope: Array,
) -> None:
    natural, damping = stage
    speed += state[1]
    taut = 0.0
    for i in range(reaches.size):
        spring = state[2 + i]
        taut += spring
        yielding = (spring / reaches[i]) ** 2 if speed * spring > 0.0 else 0.0
        slope[2 + i] = speed * (1.0 - yielding)
    force = -share * taut / reaches.size
    slope[0] = state[1]
    slope[1] = natural**2 * (force - state[0]) - 2.0 * damping * natural * state[1]
