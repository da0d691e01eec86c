"""Static nonlinearity: the displacement is a bent function of itself.

Equation: x = x₀ + a x₀² + b x₀³, a in 1/m, b in 1/m². Sources: a sensor that is not linear, a
lever's or a flexure's geometry. Assumption: nothing is remembered. The polynomial holds within
±60 µm, where it must rise everywhere; beyond, it goes on straight.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.catalogue.amounts import amounts
from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

REACH = 60e-6
"""m; more than any scanner of this size reaches."""
LEVELS = 2049
NEWTON_STEPS = 3
"""The table starts within 1 nm at worst; each step squares what is left, two reach rounding."""

QUADRATIC = Parameter("quadratic", "1/m", -4e3, 4e3, 1.0)
CUBIC = Parameter("cubic", "1/m2", -4e7, 4e7, 1e4)


class StaticNonlinearity:
    """A rising cubic, with its inverse by Newton's method; nothing is remembered.

    Raises InputError where it does not rise everywhere within the reach.
    """

    def __init__(self, quadratic: float, cubic: float) -> None:
        self._coefficients = (cubic, quadratic, 1.0, 0.0)
        self._table = np.linspace(-REACH, REACH, LEVELS)
        slope = self._value_and_slope(self._table)[1]
        if slope.min() <= 0.0:
            raise InputError(
                f"static_nonlinearity: with quadratic = {quadratic:g} 1/m and cubic ="
                f" {cubic:g} 1/m^2 the displacement turns back at"
                f" {1e6 * self._table[slope.argmin()]:.3g} um, so it has no inverse: choose smaller"
                " ones"
            )

    def at_rest(self) -> None:
        """Return no state."""

    def apply(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Displacement x of straight displacement x₀, both (n,) in m."""
        return None, self._value_and_slope(block)[0]

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Straight displacement x₀ that gives x, both (n,) in m."""
        found = np.interp(block, self._value_and_slope(self._table)[0], self._table)
        for _ in range(NEWTON_STEPS):
            value, slope = self._value_and_slope(found)
            found = found - (value - block) / slope
        return None, found

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)

    def _value_and_slope(self, straight: Array) -> tuple[Array, Array]:
        inside = np.clip(straight, -REACH, REACH)
        slope = np.polyval(np.polyder(self._coefficients), inside)
        return np.polyval(self._coefficients, inside) + slope * (straight - inside), slope


def insert(chain: Chain, values: Array) -> Chain:
    """Bend the output: quadratic (1/m) and cubic (1/m²) coefficient."""
    bent = StaticNonlinearity(*values)
    return chain.with_output(lambda _: bent)


def starts(clues: Clues) -> Iterator[tuple[float, float]]:
    """Coefficients that the residual shows, its part along the displacement left out."""
    x = clues.displacement
    _, quadratic, cubic = amounts(clues.residual, x, x**2, x**3)
    yield QUADRATIC.nearest(quadratic), CUBIC.nearest(cubic)


ENTRY = Entry(
    name="static_nonlinearity",
    equation="x = x0 + quadratic x0^2 + cubic x0^3",
    needs="large and small motion, about more than one place",
    confusable=("backlash", "cross_coupling", "hysteretic_stiffness", "parameter_shift"),
    experiment="amplitudes",
    remedy="feedforward",
    advice="if it is the sensor that bends, the true motion is straight only after correcting the"
    " sensor: compare with a grating",
    forms=(Form("", (QUADRATIC, CUBIC), insert, starts, (0.0, 0.0)),),
)
