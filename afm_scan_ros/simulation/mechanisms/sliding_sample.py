"""A sample that lies loose in its recess and slides where the scanner outruns friction.

    sticks:  w = 0                       while |x''| <= grip
    slides:  w' = -x'' - grip sgn(w)     until w = 0 and |x''| <= grip
    x_out = x + integral of w, between the recess' walls, where it stops dead

w is its speed on the scanner, grip Coulomb's friction: coefficient times gravity. A slow scan
leaves it where it is; a fast one loses it at the turns, and at a lopsided turn it comes to lie
elsewhere. Leapfrog, friction and walls as impulses (Moreau's scheme).
Source: J. J. Moreau, in Nonsmooth Mechanics and Applications, Springer 1988, 1.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SlidingSample(Insert):
    """``grip`` in m/s^2, ``room`` (m) to either wall.

    State: how far it has slid (m), w (m/s), the last x (m) and x' (m/s), shape (4,).
    """

    KIND: ClassVar[str] = "sliding_sample"
    PLACE: ClassVar[Place] = "displacement"

    grip: float = quantity(gt(0.0), suffix="_m_per_s2")
    room: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """It lies in its place."""
        return np.zeros(4)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        state = state.copy()
        return state, own + _slide(state, own, step, self.grip * step, self.room)


@compiled
def _slide(state: Array, x: Array, step: float, impulse: float, room: float) -> Array:
    slid, sliding, last, speed = state
    path = np.empty_like(x)
    for k in range(x.size):
        pace = (x[k] - last) / step
        free = sliding - (pace - speed)
        sliding = free - min(max(free, -impulse), impulse)
        slid += step * sliding
        if abs(slid) > room:
            slid, sliding = np.sign(slid) * room, 0.0
        path[k] = slid
        last, speed = x[k], pace
    state[:] = slid, sliding, last, speed
    return path
