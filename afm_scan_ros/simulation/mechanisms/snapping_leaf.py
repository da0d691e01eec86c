"""A leaf spring between stage and frame that has buckled, and snaps through as the stage moves.

    SNAP w' = w - w^3 + x / reach,    x_out = x + throw (w + 1)

Buckled, it has two rests; the stage's motion bends it until the one where it is ends, and it snaps
to the other within milliseconds: at 0.385 ``reach`` on the way up, and as far below zero on the way
down. A jump at two places, another one for each direction, and no motion lost between: neither
backlash, nor a stiffness, nor a bend, but one bistable part, which is in no catalogue.
Runge-Kutta's fourth order, x straight within a step.
Source: S. H. Strogatz, Nonlinear Dynamics and Chaos, 1994, 3.6 (imperfect bifurcations).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

SNAP = 0.3e-3  # s


@frozen(kw_only=True)
class SnappingLeaf(Insert):
    """``throw`` (m) of a rest, ``reach`` (m); state: w and the last x (m), shape (2,)."""

    KIND: ClassVar[str] = "snapping_leaf"
    PLACE: ClassVar[Place] = "displacement"

    throw: float = quantity(suffix="_nm", scale=1e-9)
    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Buckled downwards."""
        return np.array([-1.0, 0.0])

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what the leaf adds to it."""
        state = state.copy()
        return state, own + self.throw * _snap(state, own / self.reach, step / SNAP, self.reach)


@compiled
def _snap(state: Array, pull: Array, steps: float, reach: float) -> Array:
    w, last = state[0], state[1] / reach
    path = np.empty_like(pull)
    for k in range(pull.size):
        total = slope = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            trial = w + ahead * slope
            slope = steps * (trial - trial**3 + last + ahead * (pull[k] - last))
            total += weight / 6.0 * slope
        w, last = w + total, pull[k]
        path[k] = w + 1.0
    state[:] = w, last * reach
    return path
