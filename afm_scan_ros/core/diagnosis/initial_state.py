"""The initial hysteresis state of a record, as a drive history.

A depolarised scanner has no history. Any other state is given by a sequence of drive extremes,
each within those before it, since a larger extreme erases smaller ones (Preisach's wiping-out
property). Here two extremes and the drive at rest are used. An excursion to a limit saturates.
Displacement is relative, so the effective input is relative to its value at rest.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.types import Array, floats

SAMPLES_PER_MOVE = 200
"""Samples from one extreme to the next, enough for lagging elements of the drive to follow."""


@frozen
class InitialState:
    """The drive (V) before a record: from depolarised 0 V by way of ``turns`` to ``rest``."""

    turns: tuple[float, ...] = field(default=(), converter=floats)
    rest: float = 0.0

    @property
    def blank(self) -> bool:
        """Whether the scanner is depolarised and at 0 V."""
        return not self.turns and self.rest == 0.0

    def path(self) -> Array:
        """Drive (V) before the record; its last segment is at rest."""
        stops = np.array([0.0, *self.turns, self.rest, self.rest])
        progress = np.arange(SAMPLES_PER_MOVE * (len(stops) - 1)) / SAMPLES_PER_MOVE
        return np.asarray(np.interp(progress, np.arange(len(stops)), stops))

    def played(self, cascade: Cascade, drive: Array) -> Array:
        """Output (n,) of the elements up to the hysteresis, from this state on."""
        if self.blank:
            return cascade.apply(cascade.at_rest(), drive)[1]
        state, before = cascade.apply(cascade.at_rest(), self.path())
        return np.asarray(cascade.apply(state, drive)[1] - before[-1])


DEPOLARISED = InitialState()
