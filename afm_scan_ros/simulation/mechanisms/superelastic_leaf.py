"""Leaves of a superelastic alloy beside the flexures: they give way, and come back later.

    p_i = share (x - z_i) / n,    0 <= x - z_i <= reach_i while z_i grows,
    z_i falls only where x - z_i <= RETURN reach_i,  and not below 0;  mirrored where x < 0
    f = -sum p_i

Under stress the alloy turns from one lattice to another, longer one, at one stress on the way out
and at a lower one on the way back: a loop like a flag. Small motions meet springs and lose nothing;
large ones meet less stiffness, with a loss, and all of it comes back at rest: stiffness and loss
that depend on the amplitude, in feedback on the elongation (see attachment.py).
Source: F. Auricchio, R. L. Taylor, J. Lubliner, Computer Methods in Applied Mechanics and
Engineering 146 (1997) 281.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.giving_way import GivingWay, Parts, swing

RETURN = 0.5  # stress at which the alloy turns back, over that at which it turns


@frozen(eq=False)
class TurningLeaves(Parts):
    """Leaves of ``share`` (1) altogether, which begin to turn at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the leaves bend and turn."""
        stage = (self.stage.natural, self.stage.damping)
        return _bend(state, path[0], step, stage, self.share, self.reaches)


@frozen(kw_only=True)
class SuperelasticLeaf(GivingWay):
    """``share`` of the axis' stiffness that the leaves add, and where they begin to turn, m."""

    KIND: ClassVar[str] = "superelastic_leaf"
    PARTS: ClassVar[type[Parts]] = TurningLeaves


@compiled
def _bend(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    """A leaf's bend is exact, whatever the motion within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        before = path[k] + state[0]
        swing(state, step, stage, share)
        u[k] = state[0]
        x = path[k + 1] + state[0]
        for i in range(reaches.size):
            state[2 + i] = x - _turned(x, before - state[2 + i], reaches[i])
    return u


@inlined
def _turned(x: float, turned: float, reach: float) -> float:
    """Z (m) at x where it was ``turned``."""
    side = np.sign(x)
    out = min(max(side * turned, side * x - reach), side * x - RETURN * reach)
    return float(side * max(out, 0.0))
