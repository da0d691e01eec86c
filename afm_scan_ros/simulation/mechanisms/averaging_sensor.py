"""A sensor whose filter averages what it has seen lately.

    x_read(t) = (1 / window) integral of x over the last window

Its weights are even about their middle, so that every slow motion is read half a window late.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class AveragingSensor(Insert):
    """``window`` in s; state: the displacements of the last window and one before, m."""

    KIND: ClassVar[str] = "averaging_sensor"
    PLACE: ClassVar[Place] = "displacement"

    window: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """It has seen the scanner at rest."""
        return np.zeros(int(np.ceil(self.window / step)) + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) averaged; between two instants it runs straight."""
        seen, weights = np.concatenate((state, own)), _weights(self.window / step)
        read = np.zeros_like(own)
        for back, weight in enumerate(weights):
            read += weight * seen[state.size - back : seen.size - back]
        return seen[own.size :], read


def _weights(steps: float) -> Array:
    """Weights of the latest instants in the mean over ``steps`` of what runs straight between."""
    whole, weights = int(steps), np.zeros(int(np.ceil(steps)) + 1)
    weights[:whole] += 0.5
    weights[1 : whole + 1] += 0.5
    part = steps - whole
    if part > 0.0:
        weights[whole] += part * (1.0 - 0.5 * part)
        weights[whole + 1] += 0.5 * part**2
    return weights / steps
