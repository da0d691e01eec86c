"""A drive's converter that glitches in the middle of its range, where all its bits change.

    u_out = u + height    for ``lasting`` s after an update that takes u across zero
            u             otherwise

0111... and 1000... are neighbours, but while some bits have changed and others have not the output
is on its way to 1111...: a spike up, whichever way u goes. Each rings the scanner, and the piezo
remembers it. Source: W. Kester (ed.), The Data Conversion Handbook, Elsevier 2005.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class GlitchingConverter(Insert):
    """``height`` of a spike (V), ``lasting`` (s); state: the last u, V, and what is left, s."""

    KIND: ClassVar[str] = "glitching_converter"
    PLACE: ClassVar[Place] = "drive"

    height: float = quantity(suffix="_v")
    lasting: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """At zero, and no spike."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Mean drive (V) in each step, with the spikes."""
        state = state.copy()
        return state, own + self.height * _spikes(state, own, self.lasting, step)


@compiled
def _spikes(state: Array, drive: Array, lasting: float, step: float) -> Array:
    """Share of each step in which there is a spike."""
    last, left = state
    share = np.empty_like(drive)
    for k in range(drive.size):
        if (drive[k] < 0.0) != (last < 0.0):
            left = lasting
        share[k] = min(left / step, 1.0)
        left = max(left - step, 0.0)
        last = drive[k]
    state[:] = last, left
    return share
