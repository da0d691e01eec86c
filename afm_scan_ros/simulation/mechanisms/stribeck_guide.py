"""A greased guide: friction that bends bristles first, and falls as the grease takes the load.

    f' = stiffness (x' - |x'| f / g(x')),    g = friction (1 + stiction exp(-(x' / SPEED)^2))

Stribeck's curve in LuGre's bristles: at rest they hold by (1 + stiction) times what they hold by
at speed, so that a slow scan loses more in each turn than a fast one. In feedback on the motion,
several guides, each with its own reach friction / stiffness. The bristles' own damping is left out.
Source: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control 40
(1995) 419.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Stage
from afm_scan_ros.simulation.mechanisms.giving_way import GivingWay, Parts, swing
from afm_scan_ros.simulation.quantity import quantity

SPEED = 2e-3  # m/s, at which the grease begins to carry


@frozen(kw_only=True)
class StribeckGuide(GivingWay):
    """``share`` of the axis' stiffness that the bristles add, where they slip at speed, m.

    ``stiction`` (1) is by how much more they hold at rest.
    """

    KIND: ClassVar[str] = "stribeck_guide"

    stiction: float = quantity(ge(0.0))

    def attached(self, stage: Stage) -> "GreasedBristles":
        """Bristles that are all equally stiff."""
        return GreasedBristles(self.row, stage, self.share, np.array(self.reaches), self.stiction)


@frozen(eq=False)
class GreasedBristles(Parts):
    """Bristles of ``share`` (1) altogether, which slip at ``reaches`` (m) and later at rest."""

    stiction: float

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the bristles bend and slip."""
        stage = (self.stage.natural, self.stage.damping)
        return _rub(state, path[0], step, stage, self.share, self.reaches, self.stiction)


@compiled
def _rub(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
    stiction: float,
) -> Array:
    """A bristle's bend is exact for a motion that is straight within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        swing(state, step, stage, share)
        u[k] = state[0]
        moved = path[k + 1] - path[k] + step * state[1]
        held = 1.0 + stiction * np.exp(-((moved / (SPEED * step)) ** 2))
        for i in range(reaches.size):
            reach = held * reaches[i]
            end = np.sign(moved) * reach
            state[2 + i] = end + (state[2 + i] - end) * np.exp(-abs(moved) / reach)
    return u
