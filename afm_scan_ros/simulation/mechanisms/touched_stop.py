"""A stop that the stage touches on the outer part of its way: a ball on a flat (Hertz).

    x feels -push (beyond / REACH)^(3/2),    beyond = x - place, where it is above 0

The further the ball is pressed in, the wider the contact and the stiffer: nothing at all before the
stop, beyond it a force of the power 3/2 that pushes the structure back (see attachment.py) and
gives back what it took. The motion is bent by where the stage is alone: a static nonlinearity, of
one side. Leapfrog. Source: K. L. Johnson, Contact Mechanics, Cambridge 1985, 4.2.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attached, Attachment, Stage
from afm_scan_ros.simulation.quantity import quantity

REACH = 10e-6  # m, pressed by which the stop would push the stage back by ``push``


@frozen(kw_only=True)
class TouchedStop(Attachment):
    """``place`` (m) where the stop is touched; ``push`` (m), its force over the stiffness."""

    KIND: ClassVar[str] = "touched_stop"

    place: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    push: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)

    def attached(self, stage: Stage) -> "Touching":
        """Stop beside the axis."""
        return Touching(self.row, stage, self.place, self.push)


@frozen(eq=False)
class Touching(Attached):
    """A stop at ``place`` (m) of ``push`` (m)."""

    place: float
    push: float

    def own_at_rest(self) -> Array:
        """A stop remembers nothing."""
        return np.zeros(0)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the stage comes and goes."""
        stage = (self.stage.natural, self.stage.damping)
        return _push(state, path[0], step, stage, self.place, self.push / REACH**1.5)


@compiled
def _push(
    state: Array, path: Array, step: float, stage: tuple[float, float], place: float, hard: float
) -> Array:
    natural, damping = stage
    loss = damping * natural * step
    u = np.empty(path.size - 1)
    for k in range(u.size):
        pull = -hard * max(path[k] + state[0] - place, 0.0) ** 1.5 - state[0]
        state[1] = ((1.0 - loss) * state[1] + step * natural**2 * pull) / (1.0 + loss)
        state[0] += step * state[1]
        u[k] = state[0]
    return u
