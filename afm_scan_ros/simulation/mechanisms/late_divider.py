"""A light spot's sensor that divides by the light of a moment ago.

    x_read = x (1 - v) / (1 - w),    v = (x / reach)^2,    settling w' = v - w

The difference of two photocurrents is x times the light, of which an aperture takes the more the
further the spot is from its middle; the sensor divides by their sum to be rid of that. The sum is
filtered, against noise, and comes late: a slow scan is read as it is, a fast one by a gain that
breathes twice a line. It bends, but not by place alone, and its loop is gone when x rests for
``settling``: a product of position and past, which no effect of the catalogue has. Exact where v
runs straight within a step. Source: J. T. Wallmark, Proc. IRE 45 (1957) 474 (the sensor).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.mechanisms.straight import Stepping
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class LateDivider(Insert):
    """``reach`` (m) at which no light would be left, ``settling`` (s); state: w, last v."""

    KIND: ClassVar[str] = "late_divider"
    PLACE: ClassVar[Place] = "displacement"

    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    settling: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """The spot has been in the middle."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        missing, pace = (own / self.reach) ** 2, np.array([1.0 / self.settling])
        path = np.concatenate((state[1:], missing))
        filtered = Stepping.of(np.diag(-pace), pace, step).run(state[:1], path)[:, 0]
        after = np.array([filtered[-1], missing[-1]])
        return after, own * (1.0 - missing) / (1.0 - filtered)
