"""The converter's buffer: the drive reaches the scanner some time after its update.

    u_out(t) = u(t - delay)

A queue of so many whole steps and a part of one: a step in which the delayed drive changes carries
the mean of what was there before and after.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class DelayedConverter(Insert):
    """``delay`` in s; state: the drive (V) still in the queue, oldest first."""

    KIND: ClassVar[str] = "delayed_converter"
    PLACE: ClassVar[Place] = "drive"

    delay: float = quantity(ge(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Queue of a converter that was never written to."""
        return np.zeros(int(self.delay / step) + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Drive (V) that leaves the queue while ``own`` enters it."""
        waiting = np.concatenate((state, own))
        part = self.delay / step - (state.size - 1)
        leaving = (1.0 - part) * waiting[1 : own.size + 1] + part * waiting[: own.size]
        return waiting[own.size :], leaving
