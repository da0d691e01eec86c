"""A pad of wet foam under the sample: what is loaded gives way as fast as its water drains.

    dp/dt = c d2p/ds2 + dx/dt,    p = 0 where it drains,    no flow at the other side
    x_out = x + share mean(x - p)

Water cannot be squeezed: a new load, in proportion to x as that of the flexures is, rests on its
pressure p at first, and goes over to the foam as the water flows off (consolidation). By the root
of time to begin with, as an exponential in the end; taken back when the load goes: slow creep.
x - p is solved by its first eigenfunctions, exactly for an x that runs straight within a step; the
rest, 2 / (pi^2 TERMS) of all, follows at once.
Source: K. Terzaghi, Theoretical Soil Mechanics, Wiley 1943, 13.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

TERMS = 40
ROOTS = np.pi * (np.arange(TERMS, dtype=np.float64) + 0.5)
SHARES = 2.0 / ROOTS**2


@frozen(kw_only=True)
class DrainingPad(Insert):
    """``share`` of x by which it gives way, ``draining`` thickness^2 / c (s).

    State: the eigenfunctions and the last x, m, shape (TERMS + 1,).
    """

    KIND: ClassVar[str] = "draining_pad"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity()
    draining: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Not loaded."""
        return np.zeros(TERMS + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what has given way."""
        state = state.copy()
        given = _drain(state, own, step / self.draining * ROOTS**2, SHARES)
        return state, own + self.share * given


@compiled
def _drain(state: Array, x: Array, steps: Array, shares: Array) -> Array:
    kept = np.exp(-steps)
    lasting = (1.0 - kept) / steps
    at_once = 1.0 - shares.sum()
    given = np.empty_like(x)
    for k in range(x.size):
        total, moved = at_once * x[k], x[k] - state[-1]
        for i in range(shares.size):
            state[i] = x[k] + kept[i] * (state[i] - state[-1]) - lasting[i] * moved
            total += shares[i] * state[i]
        state[-1] = x[k]
        given[k] = total
    return given
