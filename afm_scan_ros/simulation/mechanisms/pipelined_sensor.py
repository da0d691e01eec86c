"""A sensor whose converter runs by a clock of its own, and gives what it took some ticks ago.

    x_read(t) = x(tick - LATENCY clock),    tick = the last one of its clock at or before t

A converter that works in a pipeline is busy with several readings at once, and each comes out late
by as many ticks as it has stages; who asks between two ticks is given the older one. So a reading
is late by LATENCY + 1/2 clocks on the average, the same at every rate, and by half a clock more or
less. Exact for a displacement that runs straight within a step.
Source: W. Kester (ed.), The Data Conversion Handbook, Elsevier 2005, 3.2.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

LATENCY = 3


@frozen(kw_only=True)
class PipelinedSensor(Insert):
    """``clock``: its period in s.

    State: elapsed steps, share of a tick that had gone by at first, displacements since, m.
    """

    KIND: ClassVar[str] = "pipelined_sensor"
    PLACE: ClassVar[Place] = "displacement"

    clock: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, float, Array]:
        """It has seen the scanner at rest."""
        return 0, float(rng.uniform()), np.zeros(int((LATENCY + 1) * self.clock / step) + 2)

    def act(
        self,
        state: tuple[int, float, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, float, Array], Array]:
        """Displacement (m) as it is read."""
        elapsed, gone, seen = state
        oldest, clock = elapsed - seen.size, self.clock / step
        seen = np.concatenate((seen, own))
        tick = np.floor(np.arange(elapsed, elapsed + own.size) / clock + gone) - gone
        taken = (tick - LATENCY) * clock
        after = np.ceil(taken)
        late, ends = after - taken, after.astype(int) - oldest
        read = seen[ends] - late * (seen[ends] - seen[ends - 1])
        return (elapsed + own.size, gone, seen[own.size :]), read
