"""A pad of polymer under the sample, which creeps by a power of time.

    x_out(t) = x(t) + share integral J(t - s) dx(s),    J(t) = (t / second)^power

Its kernel is a sum of exponentials, spaced three to a decade, weighted as the power's spectrum.
Source: F. Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity, 2010, 2.4.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

TAUS = np.logspace(-3, 4, 22)


@frozen(kw_only=True)
class PolymerPad(Insert):
    """``share`` by which it creeps in a second, ``power`` of time; state: elements and x, m."""

    KIND: ClassVar[str] = "polymer_pad"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity(gt(0.0))
    power: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing has crept."""
        return np.zeros(TAUS.size + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what has crept."""
        weights = TAUS**self.power
        weights *= self.share / float(weights @ -np.expm1(-1.0 / TAUS))
        state = state.copy()
        return state, own + _creep(state, own, -np.expm1(-step / TAUS), weights)


@compiled
def _creep(state: Array, x: Array, done: Array, weights: Array) -> Array:
    crept = np.empty_like(x)
    for k in range(x.size):
        middle = 0.5 * (state[-1] + x[k])
        state[-1] = x[k]
        crept[k] = 0.0
        for i in range(done.size):
            state[i] += done[i] * (middle - state[i])
            crept[k] += weights[i] * state[i]
    return crept
