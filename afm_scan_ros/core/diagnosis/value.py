"""What a parameter came to, and whether the catalogue's range or the records tell it."""

import math

from attrs import frozen

from afm_scan_ros.core.effects.effect_type import EffectParameter

EDGE, EDGE_OF_HALF = 1e-3, 1e-2
"""Shares of an end of the range and of half the interval: a value so near to that end is at it."""


@frozen(eq=False)
class Value:
    """A parameter's value in its unit, with its 95 % interval."""

    parameter: EffectParameter
    value: float
    halfwidth: float

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval, as far as the catalogue allows them."""
        ends = self.value - self.halfwidth, self.value + self.halfwidth
        low, high = map(self.parameter.nearest, ends)
        return low, high

    @property
    def cut(self) -> bool:
        """Whether the interval goes beyond what the catalogue allows."""
        low, high = self.interval
        return math.isfinite(self.halfwidth) and high - low < 2.0 * self.halfwidth * (1.0 - 1e-9)

    @property
    def at_edge(self) -> bool:
        """Whether the value is all that the catalogue allows, so that the records leave it open."""
        half = self.halfwidth if math.isfinite(self.halfwidth) else 0.0
        ends = self.parameter.lower, self.parameter.upper
        return any(abs(self.value - e) <= max(EDGE * abs(e), EDGE_OF_HALF * half) for e in ends)
