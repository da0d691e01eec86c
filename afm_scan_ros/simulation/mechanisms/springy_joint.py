"""A joint with play and a return spring across it: the play hides a part of the motion only.

x_out = (1 - share) p + share x,    p <- min(max(p, x - gap), x + gap)
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SpringyJoint(Insert):
    """``gap`` (m) to either side, ``share`` that passes within it; state: p, m."""

    KIND: ClassVar[str] = "springy_joint"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    share: float = quantity(ge(0.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """In the middle of the play."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        dragged = _drag(state, own, self.gap)
        return float(dragged[-1]), (1.0 - self.share) * dragged + self.share * own


@compiled
def _drag(place: float, x: Array, gap: float) -> Array:
    path = np.empty_like(x)
    for k in range(x.size):
        place = min(max(place, x[k] - gap), x[k] + gap)
        path[k] = place
    return path
