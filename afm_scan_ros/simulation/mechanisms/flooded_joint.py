"""A joint with play that is flooded with oil: films in place of contacts.

    film (x' - x_out') / p^3 = drag x_out',    p = 1 -+ (x - x_out) / gap

p is the thickness of the film that the motion squeezes, over the gap; the other one cavitates and
pulls at nothing. A thin film holds by its cube (Reynolds), the slide by its grease: both in
proportion to speed, so that speed falls out, and film / drag = FILM is how much of the motion gets
across half-way. The sample hardly moves within the play, is taken along ever better towards its
ends and never touches: backlash, as it is left behind by nearly twice the gap at each reversal.

Along a motion p - FILM / (2 p^2) falls by what is travelled over the gap: solved by Newton's
method.
Source: B. J. Hamrock, Fundamentals of Fluid Film Lubrication, 1994 (squeeze films).
"""

from math import sqrt
from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

FILM = 0.01


@frozen(kw_only=True)
class FloodedJoint(Insert):
    """``gap`` (m) to either side. State: where sample and scanner are, m, shape (2,)."""

    KIND: ClassVar[str] = "flooded_joint"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(gt(0.0), suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """In the middle of the play."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        state = state.copy()
        return state, _drag(state, own, self.gap, FILM)


@compiled
def _drag(state: Array, x: Array, gap: float, film: float) -> Array:
    sample, last = state
    path = np.empty_like(x)
    for k in range(x.size):
        side = np.sign(x[k] - last)
        if side != 0.0:
            thickness = 1.0 - side * (last - sample) / gap
            left = thickness - 0.5 * film / thickness**2 - abs(x[k] - last) / gap
            sample = x[k] - side * gap * (1.0 - _squeezed(left, film))
        last = x[k]
        path[k] = sample
    state[:] = sample, last
    return path


@compiled
def _squeezed(left: float, film: float) -> float:
    """Return p of p - film / (2 p^2) = ``left``, which is 2 at most; Newton climbs to it."""
    p, before = max(left, sqrt(0.5 * film / (2.0 - left))), 0.0
    while p - before > 1e-15 * p:
        before = p
        p += (left - p + 0.5 * film / p**2) / (1.0 + film / p**3)
    return p
