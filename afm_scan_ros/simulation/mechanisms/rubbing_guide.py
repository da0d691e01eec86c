"""A guide that rubs on the stage: Dahl's friction, in feedback on the motion.

    f' = stiffness x' (1 - (f / friction) sgn x')

Bristles bend with the motion until they slip: small motions meet a spring, large ones a constant
force against them. Several guides, each with its own reach friction / stiffness.
Source: P. R. Dahl, AIAA J. 14 (1976) 1675.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.giving_way import GivingWay, Parts, swing


@frozen(eq=False)
class Bristles(Parts):
    """Bristles of ``share`` (1) altogether, which slip at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the bristles bend and slip."""
        stage = (self.stage.natural, self.stage.damping)
        return _rub(state, path[0], step, stage, self.share, self.reaches)


@frozen(kw_only=True)
class RubbingGuide(GivingWay):
    """``share`` of the axis' stiffness that the bristles add, and where they slip, m."""

    KIND: ClassVar[str] = "rubbing_guide"
    PARTS: ClassVar[type[Parts]] = Bristles


@compiled
def _rub(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    """A bristle's bend is exact for a motion that is straight within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        swing(state, step, stage, share)
        u[k] = state[0]
        moved = path[k + 1] - path[k] + step * state[1]
        for i in range(reaches.size):
            end = np.sign(moved) * reaches[i]
            state[2 + i] = end + (state[2 + i] - end) * np.exp(-abs(moved) / reaches[i])
    return u
