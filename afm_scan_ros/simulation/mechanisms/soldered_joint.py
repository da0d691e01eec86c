"""A joint of soft solder under the sample, which creeps by the cube of its stress.

    settling z' = (x - z) ((x - z) / REACH)^2,    x_out = x + share z

The joint carries what bends the flexures, in proportion to x; what has crept is held by the elastic
parts beside the solder, and creeps back when the load goes. Its dislocations drag foreign atoms
along, and their number and their speed both grow with the stress: the natural law of power three,
fast under a large stress and hardly at all near the end. What goes on moving while a level is held,
and is given back after it: slow creep. Runge-Kutta's fourth order, x straight within a step.
Source: H. J. Frost, M. F. Ashby, Deformation-Mechanism Maps, Pergamon 1982, 2.4.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

REACH = 10e-6  # m, of which ``settling`` is the time constant


@frozen(kw_only=True)
class SolderedJoint(Insert):
    """``share`` of the displacement by which it creeps, ``settling`` (s) at ``REACH``.

    State: z and the last x, m, shape (2,).
    """

    KIND: ClassVar[str] = "soldered_joint"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity()
    settling: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing has crept."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what has crept."""
        state = state.copy()
        return state, own + self.share * _creep(state, own, step / (self.settling * REACH**2))


@compiled
def _creep(state: Array, x: Array, pace: float) -> Array:
    z, last = state
    crept = np.empty_like(x)
    for k in range(x.size):
        total = slope = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            stress = last + ahead * (x[k] - last) - (z + ahead * slope)
            slope = pace * stress**3
            total += weight / 6.0 * slope
        z, last = z + total, x[k]
        crept[k] = z
    state[:] = z, last
    return crept
