"""What the scanner's hysteresis remembers when a record begins.

A depolarised scanner remembers nothing. Any other went through extremes of the drive of which
each lies within those before, for a farther one wipes out the nearer (Preisach); two of them and
the drive at which it rested are all that matters beside the record's own. An excursion to a limit
saturates. Displacement is relative, so the effective input counts from its value at that rest.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.effects.coefficients import coefficients
from afm_scan_ros.core.types import Array

SAMPLES_PER_MOVE = 200
"""Samples from one extreme to the next: elements of the drive that lag must follow."""
NEAR_LIMIT = 0.95
"""Share of the identified range from which on an excursion saturates."""


@frozen
class InitialState:
    """The drive (V) before a record: from depolarised 0 V by way of ``turns`` to ``rest``."""

    turns: tuple[float, ...] = field(default=(), converter=coefficients)
    rest: float = 0.0

    @property
    def blank(self) -> bool:
        """Whether the scanner is depolarised and at 0 V."""
        return not self.turns and self.rest == 0.0

    def words(self, limits: tuple[float, float]) -> str:
        """What the scanner was, ``limits`` (V) being those of the identified drive."""
        if not self.turns:
            return "depolarised" if self.blank else f"depolarised, at rest at {self.rest:.2g} V"
        lower, upper = (NEAR_LIMIT * limit for limit in limits)
        last = self.turns[-1]
        if not lower < last < upper:
            return f"saturated at its {'upper' if last > 0.0 else 'lower'} end"
        been = " and then ".join(f"{turn:.2g} V" for turn in self.turns)
        return f"as left by a drive to {been}, at rest at {self.rest:.2g} V"

    def path(self) -> Array:
        """Drive (V) before the record, its last leg at rest."""
        stops = np.array([0.0, *self.turns, self.rest, self.rest])
        legs = np.arange(SAMPLES_PER_MOVE * (len(stops) - 1)) / SAMPLES_PER_MOVE
        return np.asarray(np.interp(legs, np.arange(len(stops)), stops))

    def played(self, cascade: Cascade, drive: Array) -> Array:
        """Output (n,) of the elements up to the hysteresis, from this memory on."""
        if self.blank:
            return cascade.apply(cascade.at_rest(), drive)[1]
        state, before = cascade.apply(cascade.at_rest(), self.path())
        return np.asarray(cascade.apply(state, drive)[1] - before[-1])


DEPOLARISED = InitialState()
