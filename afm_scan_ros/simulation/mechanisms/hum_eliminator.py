"""A box in the sensor's lead that learns the hum of the mains, and takes it away: and the scan's.

    x_read = x - m,    m(t) = -((1 - learning) m(t - HALF) + learning x(t - HALF))

Hum turns its sign every half period of the mains: the box goes on averaging what does, and takes
away what it has learnt. Of a scan it learns what it should not, and every line comes back in the
next ones each HALF, upside down and right again in turn, ever weaker: echoes, which all add up for
a harmonic of the line rate on an odd one of the mains. A comb; no effect of the catalogue speaks
of what was read lines ago. Between steps it is read straight.
Source: B. Widrow et al., Proceedings of the IEEE 63 (1975) 1692 (adaptive noise cancelling).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

HALF = 10e-3  # s, half a period of the mains


@frozen(kw_only=True)
class HumEliminator(Insert):
    """``learning``: share that each half period has in what is learnt.

    State: elapsed steps, and what m will be in HALF, less its sign, m, a ring of all steps.
    """

    KIND: ClassVar[str] = "hum_eliminator"
    PLACE: ClassVar[Place] = "displacement"

    learning: float = quantity(ge(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, Array]:  # noqa: ARG002
        """Nothing learnt."""
        return 0, np.zeros(int(HALF / step) + 1)

    def act(
        self,
        state: tuple[int, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, Array], Array]:
        """Displacement (m) as it is read."""
        elapsed, ring = state[0], state[1].copy()
        between = HALF / step - int(HALF / step)
        read = _listen(ring, own, elapsed % ring.size, between, self.learning)
        return (elapsed + own.size, ring), read


@compiled
def _listen(ring: Array, x: Array, first: int, between: float, learning: float) -> Array:
    read = np.empty_like(x)
    for k in range(x.size):
        now = (first + k) % ring.size
        after = (now + 1) % ring.size
        hum = -(between * ring[now] + (1.0 - between) * ring[after])
        ring[now] = (1.0 - learning) * hum + learning * x[k]
        read[k] = x[k] - hum
    return read
