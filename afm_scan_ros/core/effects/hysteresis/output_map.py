"""A memoryless map behind a Preisach operator: F = g(A), given by its inverse, a polynomial.

    A = F + sum of c_j (z^(j + 2) - z^(j mod 2)),    z = 2 (F - lower) / (upper - lower) - 1

F (V) is the effective input and A (V) the operator's output; both agree at ``lower`` and
``upper``, which fixes the gauge. Beyond these the map goes on straight. A map before the operator
needs no place of its own: P(h(u)) is a Preisach operator too, E(h(alpha), h(beta)) its surface.
What a map behind adds is that minor loops between equal inputs need not be congruent. So plays
between two maps, whose inverse is of that form again, are such an operator exactly.
Source: M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, Springer 1996, 2.2 and 2.4.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.effects.base import StatelessEffect
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, floats

LEVELS = 2049
NEWTON_STEPS = 3
"""The table starts within 1e-6 of the range; each step squares the error."""


def terms(outputs: Array, lower: float, upper: float, count: int) -> Array:
    """What each coefficient is multiplied by at outputs F (V) of shape (n,): shape (n, count)."""
    z = (2.0 * (outputs - lower) / (upper - lower) - 1.0)[:, np.newaxis]
    powers = np.arange(count)
    return np.asarray(z ** (powers + 2) - z ** (powers % 2))


@frozen
class OutputMap(StatelessEffect):
    """The map of a Preisach operator's output A (V) to the effective input F (V), and back.

    ``coefficients`` are those of the docstring above, in V. Raises InputError unless it rises
    everywhere between ``lower`` and ``upper`` (V).
    """

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    coefficients: tuple[float, ...] = field(converter=floats)
    _levels: Array = field(init=False, eq=False, repr=False)
    _bent: Array = field(init=False, eq=False, repr=False)

    @_levels.default
    def _spaced(self) -> Array:
        if not self.lower < self.upper or not np.isfinite([self.lower, self.upper]).all():
            raise InputError(f"an output map needs lower < upper: {self.lower}, {self.upper}")
        return np.linspace(self.lower, self.upper, LEVELS)

    @_bent.default
    def _rising(self) -> Array:
        bent, slope = self._bend(self._levels)
        if not slope.min() > 0.0:
            raise InputError(
                "the map behind the hysteresis turns back at an effective input of"
                f" {self._levels[slope.argmin()]:.4g} V, so it has no inverse"
            )
        return bent

    def _bend(self, outputs: Array) -> tuple[Array, Array]:
        """A at outputs F (V), and dA/dF."""
        half = 0.5 * (self.upper - self.lower)
        z = np.clip((outputs - self.lower) / half - 1.0, -1.0, 1.0)
        powers = np.zeros(len(self.coefficients) + 2)
        for j, coefficient in enumerate(self.coefficients):
            powers[j + 2] += coefficient
            powers[j % 2] -= coefficient
        curve = np.polynomial.Polynomial(powers)
        tilt = curve.deriv()(z) / half
        straight = outputs - (self.lower + half * (z + 1.0))
        return outputs + curve(z) + tilt * straight, 1.0 + tilt

    def input(self, outputs: Array) -> Array:
        """Operator's outputs A (V) for effective inputs F (V), both (n,)."""
        return self._bend(outputs)[0]

    def output(self, inputs: Array) -> Array:
        """Effective inputs F (V) for the operator's outputs A (V), both (n,)."""
        beyond = inputs - np.clip(inputs, self.lower, self.upper)
        found = np.interp(inputs, self._bent, self._levels) + beyond
        for _ in range(NEWTON_STEPS):
            bent, slope = self._bend(found)
            found = found - (bent - inputs) / slope
        return found
