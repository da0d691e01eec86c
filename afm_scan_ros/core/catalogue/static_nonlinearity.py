"""Static nonlinearity: the displacement is a bent function of itself.

Equation: x = x₀ + a x₀² + b x₀³, a in 1/m, b in 1/m². Sources: a sensor that is not linear, a
lever's or a flexure's geometry. Assumption: nothing is remembered. The polynomial holds within
±40 µm, where it must rise everywhere; beyond, it goes on straight.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.catalogue.amounts import amounts
from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

REACH = 40e-6
"""m; as far as a scanner of this size goes."""
LEVELS = 2049
NEWTON_STEPS = 3
"""The table starts within 1 nm at worst; each step squares what is left, two reach rounding."""

QUADRATIC = Parameter("quadratic", "1/m", -4e3, 4e3, 1.0)
CUBIC = Parameter("cubic", "1/m2", -1.6e8, 3e8, 1e4)


@compiled
def _bend(quadratic: float, cubic: float, block: Array, bent: Array, slope: Array) -> None:
    for k in range(block.size):
        x = min(max(block[k], -REACH), REACH)
        slope[k] = 1.0 + (2.0 * quadratic + 3.0 * cubic * x) * x
        bent[k] = (1.0 + (quadratic + cubic * x) * x) * x + slope[k] * (block[k] - x)


class StaticNonlinearity:
    """A rising cubic, with its inverse by Newton's method; nothing is remembered.

    Raises InputError where it does not rise everywhere within the reach.
    """

    def __init__(self, quadratic: float, cubic: float) -> None:
        self._coefficients = quadratic, cubic
        self._straight = np.linspace(-REACH, REACH, LEVELS)
        self._bent, slope = self._bend(self._straight)
        if slope.min() <= 0.0:
            raise InputError(
                f"static_nonlinearity: with quadratic = {quadratic:g} 1/m and cubic ="
                f" {cubic:g} 1/m2 the displacement turns back at"
                f" {1e6 * self._straight[slope.argmin()]:.3g} um, so it has no inverse: choose"
                " smaller ones"
            )

    def at_rest(self) -> None:
        """Return no state."""

    def apply(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Displacement x of straight displacement x₀, both (n,) in m."""
        return None, self._bend(block)[0]

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Straight displacement x₀ that gives x, both (n,) in m."""
        found = np.interp(block, self._bent, self._straight)
        for _ in range(NEWTON_STEPS):
            bent, slope = self._bend(found)
            found = found - (bent - block) / slope
        return None, found

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)

    def _bend(self, straight: Array) -> tuple[Array, Array]:
        bent, slope = np.empty_like(straight), np.empty_like(straight)
        _bend(*self._coefficients, straight, bent, slope)
        return bent, slope


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
