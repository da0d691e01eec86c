"""A joint with play between scanner and sample.

    drag dx_out/dt = k (x - x_out - gap)    where x - x_out > gap    (one side touches)
                     k (x - x_out + gap)    where x - x_out < -gap   (the other)
                     0                      between

The contact is a spring k, the sample's slide is greased. The time constant drag / k is that in
which a contact settles: exact while the displacement is held for a step.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class LooseJoint(Insert):
    """``gap`` (m) to either side, ``contact_time`` (s).

    State: where sample and scanner are, m, shape (2,).
    """

    KIND: ClassVar[str] = "loose_joint"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    contact_time: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """In the middle of the play."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        state = state.copy()
        return state, _drag(state, own, self.gap, step / self.contact_time)


@compiled
def _drag(state: Array, displacement: Array, gap: float, steps: float) -> Array:
    sample, last = state
    kept = np.exp(-steps)
    path = np.empty_like(displacement)
    for k in range(displacement.size):
        pressed = _beyond(last - sample, gap)
        unmoved = _beyond(displacement[k] - sample, gap)
        left = kept * pressed + (1.0 - kept) / steps * (unmoved - pressed)
        sample += unmoved - left
        last = displacement[k]
        path[k] = sample
    state[0], state[1] = sample, last
    return path


@compiled
def _beyond(distance: float, gap: float) -> float:
    return distance - min(max(distance, -gap), gap)
