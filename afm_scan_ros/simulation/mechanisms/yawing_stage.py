"""A stage that yaws as the other axis pushes it beside its middle, seen by a sensor off its axis.

    inertia theta'' + c theta' + kappa theta = offset (k y + m y'')
    x_read = x + arm theta

Abbe's error: the push is what bends the other axis' flexures and moves the stage's mass, and the
``offset`` of its line from the middle turns the stage on them. With z'' + 2 d w z' + w^2 z = w^2 y
of the yaw's own resonance and FLEXURES^2 = k / m, arm theta = share (z + z'' / FLEXURES^2). Read in
one axis and caused by the other alone, slowly in proportion to it: cross coupling. Exact for a y
that runs straight within a step. Source: E. Abbe, Zeitschrift fuer Instrumentenkunde 10 (1890) 446.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.mechanisms.straight import Stepping
from afm_scan_ros.simulation.quantity import quantity

FLEXURES = 2.0 * np.pi * 260.0  # rad/s, of the stage's mass on the other axis' flexures


@frozen(kw_only=True)
class YawingStage(Insert):
    """``share`` of the other axis that is read slowly; the yaw's ``frequency`` (Hz), ``damping``.

    State: z (m), z' (m/s) and the last y, m, shape (3,).
    """

    KIND: ClassVar[str] = "yawing_stage"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity()
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing has turned."""
        return np.zeros(3)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:
        """Displacement (m) as it is read."""
        natural = 2.0 * np.pi * self.frequency
        loss = 2.0 * self.damping * natural
        flow, entry = np.array([[0.0, 1.0], [-(natural**2), -loss]]), np.array([0.0, natural**2])
        path = np.concatenate((state[2:], other))
        turned = Stepping.of(flow, entry, step).run(state[:2], path)
        z, speed = turned.T
        pushed = natural**2 * (other - z) - loss * speed
        after = np.array([z[-1], speed[-1], other[-1]])
        return after, own + self.share * (z + pushed / FLEXURES**2)
