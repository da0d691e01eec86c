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
    """``gap`` (m) to either side, ``contact_time`` (s); state: where the sample is, m."""

    KIND: ClassVar[str] = "loose_joint"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    contact_time: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """In the middle of the play."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        return _drag(state, own, self.gap, -np.expm1(-step / self.contact_time))


@compiled
def _drag(sample: float, displacement: Array, gap: float, done: float) -> tuple[float, Array]:
    path = np.empty_like(displacement)
    for k in range(displacement.size):
        x = displacement[k]
        target = min(max(sample, x - gap), x + gap)
        sample += done * (target - sample)
        path[k] = sample
    return sample, path
