"""A mount that pops from one rest to another and back: a random telegraph.

    x_out = x + jump s,    s = 0 or 1, which changes with probability dt / dwell

Glue that cracks, a wire that touches, a charge in the sensor.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

POPS = 100_000


@frozen(kw_only=True)
class PoppingMount(Insert):
    """``jump`` (m), mean ``dwell`` (s) at each rest; state: elapsed steps, pops (s)."""

    KIND: ClassVar[str] = "popping_mount"
    PLACE: ClassVar[Place] = "displacement"

    jump: float = quantity(suffix="_nm", scale=1e-9)
    dwell: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, Array]:  # noqa: ARG002
        """At one rest; when it pops is chance, drawn once for a long while."""
        return 0, np.cumsum(rng.exponential(self.dwell, POPS))

    def act(
        self,
        state: tuple[int, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, Array], Array]:
        """Displacement (m) with the jumps so far."""
        elapsed, pops = state
        time = step * np.arange(elapsed, elapsed + own.size)
        if time[-1] > pops[-1]:
            raise InputError(f"popping_mount: the scan outlasts {POPS} pops: make dwell_s longer")
        side = np.searchsorted(pops, time, side="right") % 2
        return (elapsed + own.size, pops), own + self.jump * side
