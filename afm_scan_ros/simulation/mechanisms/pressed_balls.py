"""Balls of a worn guide that are pressed on their race, and slip from the rim of each contact on.

    f = -(2/3) share reach (1 - (1 - x / reach)^(3/2))    on the way up from rest

A sphere on a flat that is pulled along sticks in the middle and slips at the rim, where no pressure
holds it; the ring that slips grows inwards, and at ``reach`` all of it slides. After each reversal
it begins anew, and takes twice the way (Masing). So the guide is a spring of ``share`` of the axis'
stiffness that softens with the amplitude and loses the cube of a small one, in feedback on the
motion (see attachment.py). It is made of springs that slip one after another: the law above has a
share of 1 - (1 - r / reach)^(1/2) of them slip before r.
Source: R. D. Mindlin, H. Deresiewicz, J. Applied Mechanics 20 (1953) 327; W. D. Iwan, ibid. 33
(1966) 893.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attachment, Stage
from afm_scan_ros.simulation.mechanisms.giving_way import Parts, swing
from afm_scan_ros.simulation.quantity import quantity

RINGS = 30


@frozen(kw_only=True)
class PressedBalls(Attachment):
    """``share`` of the axis' stiffness that sticking balls add; ``reach`` (m) where all slide."""

    KIND: ClassVar[str] = "pressed_balls"

    share: float = quantity(ge(0.0))
    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def attached(self, stage: Stage) -> "SlippingRings":
        """Rings that are all equally stiff, the outermost first."""
        inner = 1.0 - (np.arange(RINGS, dtype=np.float64) + 0.5) / RINGS
        return SlippingRings(self.row, stage, self.share, self.reach * (1.0 - inner**2))


@frozen(eq=False)
class SlippingRings(Parts):
    """Rings of ``share`` (1) altogether, which slip at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the rings stick and slip."""
        stage = (self.stage.natural, self.stage.damping)
        return _rub(state, path[0], step, stage, self.share, self.reaches)


@compiled
def _rub(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    """A ring's bend is exact, whatever the motion within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        swing(state, step, stage, share)
        u[k] = state[0]
        moved = path[k + 1] - path[k] + step * state[1]
        for i in range(reaches.size):
            state[2 + i] = min(max(state[2 + i] + moved, -reaches[i]), reaches[i])
    return u
