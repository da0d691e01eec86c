"""Static nonlinearity: the displacement is a bent function of itself.

Equation: x = x₀ + a x₀² + b x₀³ + c x₀⁴ + d x₀⁵, a in 1/m, b in 1/m² and so on; or the same of the
drive, before the hysteresis, in 1/V and so on. Sources: a sensor that is not linear, a lever's or a
flexure's geometry; an amplifier near its rails. Most bend little, and the first two terms are all
that shows; what moves alike to either side has the odd ones alone. Assumption: nothing is
remembered. The polynomial holds within ±40 µm or ±5 V, where it must rise everywhere; beyond, it
goes on straight.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.amounts import amounts
from afm_scan_ros.core.effects.base import StatelessEffect
from afm_scan_ros.core.effects.coefficients import coefficients
from afm_scan_ros.core.effects.entry import Entry, Form, Parameter
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

REACH, REACH_V = 40e-6, 5.0
"""m and V; as far as a scanner of this size goes."""
LEVELS = 2049
NEWTON_STEPS = 3
"""The table starts within 1 nm at worst; each step squares what is left, two reach rounding."""

QUADRATIC = Parameter("quadratic", "1/m", -4e3, 4e3, 1.0)
CUBIC = Parameter("cubic", "1/m2", -1.6e8, 3e8, 1e4)
QUARTIC = Parameter("quartic", "1/m3", -8e12, 8e12, 1e8)
QUINTIC = Parameter("quintic", "1/m4", -4e17, 4e17, 1e13)
QUADRATIC_V = Parameter("quadratic", "1/V", -0.04, 0.04, 1e-6)
CUBIC_V = Parameter("cubic", "1/V2", -0.012, 0.02, 1e-7)
QUINTIC_V = Parameter("quintic", "1/V4", -1.6e-3, 1.6e-3, 1e-8)
POWERS = {"quadratic": 2, "cubic": 3, "quartic": 4, "quintic": 5}


@compiled
def _bend(coefficients: Array, reach: float, block: Array, bent: Array, slope: Array) -> None:
    for k in range(block.size):
        x = min(max(block[k], -reach), reach)
        bent[k], slope[k] = 0.0, 0.0
        for i in range(coefficients.size - 1, -1, -1):
            slope[k] = slope[k] * x + bent[k]
            bent[k] = bent[k] * x + coefficients[i]
        bent[k] += slope[k] * (block[k] - x)


@frozen
class StaticNonlinearity(StatelessEffect):
    """A rising polynomial, with its inverse by Newton's method.

    ``coefficients`` are those of x₀⁰, x₀¹ and on. Raises InputError where it does not rise
    everywhere within the ``reach``, m or V.
    """

    coefficients: tuple[float, ...] = field(converter=coefficients)
    reach: float = REACH
    _straight: Array = field(init=False, eq=False)
    _bent: Array = field(init=False, eq=False)

    @_straight.default
    def _levels(self) -> Array:
        return np.linspace(-self.reach, self.reach, LEVELS)

    @_bent.default
    def _rising(self) -> Array:
        """Curve at the levels."""
        bent, slope = self._bend(self._straight)
        if slope.min() <= 0.0:
            raise InputError(
                "static_nonlinearity: with these coefficients the curve turns back at"
                f" {self._straight[slope.argmin()] / self.reach:.3g} of its reach, {self.reach:g},"
                " so it has no inverse: choose smaller ones"
            )
        return bent

    def output(self, inputs: Array) -> Array:
        """Displacement x (m) of straight displacement x₀ (m), both (n,); or the same of volts."""
        return self._bend(inputs)[0]

    def input(self, outputs: Array) -> Array:
        """Straight displacement x₀ (m) that gives x (m), both (n,); or the same of volts."""
        found = np.interp(outputs, self._bent, self._straight)
        for _ in range(NEWTON_STEPS):
            bent, slope = self._bend(found)
            found = found - (bent - outputs) / slope
        return found

    def _bend(self, straight: Array) -> tuple[Array, Array]:
        bent, slope = np.empty_like(straight), np.empty_like(straight)
        _bend(np.array(self.coefficients), self.reach, straight, bent, slope)
        return bent, slope


def polynomial(parameters: Sequence[Parameter], values: Array) -> Array:
    """Coefficients of x₀⁰, x₀¹ and on, where those of some ``POWERS`` have values."""
    found = np.zeros(1 + max(POWERS.values()))
    found[[1, *(POWERS[p.name] for p in parameters)]] = 1.0, *values
    return found


def form(kind: str, *parameters: Parameter, refines: str | None = None) -> Form:
    """Form of which the polynomial has these terms beyond the first."""

    def insert(chain: Chain, values: Array) -> Chain:
        """Bend the output."""
        return chain.with_output(StaticNonlinearity(polynomial(parameters, values)))

    def starts(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
        """Coefficients that the residual shows, its part along the displacement left out."""
        yield _seen(parameters, features.residual, features.displacement)

    return Form(kind, parameters, insert, starts, (0.0,) * len(parameters), refines)


def form_of_drive(kind: str, *parameters: Parameter) -> Form:
    """Form of which the polynomial bends the drive."""

    def insert(chain: Chain, values: Array) -> Chain:
        """Bend the drive."""
        return chain.with_drive(StaticNonlinearity(polynomial(parameters, values), REACH_V))

    def starts(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
        """Coefficients that the residual shows, by the gain of the record as a whole."""
        moved = np.std(features.displacement)
        volts = np.std(features.drive) / moved * features.residual if moved else features.residual
        yield _seen(parameters, volts, features.drive)

    return Form(kind, parameters, insert, starts, (0.0,) * len(parameters), refines="")


def _seen(parameters: Sequence[Parameter], residual: Array, x: Array) -> tuple[float, ...]:
    _, *found = amounts(residual, x, *(x ** POWERS[p.name] for p in parameters))
    return tuple(p.nearest(each) for p, each in zip(parameters, found, strict=True))


ENTRY = Entry(
    name="static_nonlinearity",
    equation="x = x0 + quadratic x0^2 + cubic x0^3 + quartic x0^4 + quintic x0^5, or the same of u",
    needs="large and small motion, about more than one place",
    confusable=("backlash", "cross_coupling", "hysteretic_stiffness", "parameter_shift"),
    experiment="amplitudes",
    remedy="feedforward",
    advice="if it is the sensor that bends, the true motion is straight only after correcting the"
    " sensor: compare with a grating",
    forms=(
        form("", QUADRATIC, CUBIC),
        form("odd", CUBIC, refines=""),
        form("odd_quintic", CUBIC, QUINTIC, refines=""),
        form("quartic", QUADRATIC, CUBIC, QUARTIC, refines=""),
        form("quintic", QUADRATIC, CUBIC, QUARTIC, QUINTIC, refines=""),
        form_of_drive("drive", QUADRATIC_V, CUBIC_V),
        form_of_drive("drive_odd_quintic", CUBIC_V, QUINTIC_V),
    ),
    words={
        "": "of the sensor",
        "odd": "of the sensor, odd",
        "odd_quintic": "of the sensor, odd quintic",
        "quartic": "of the sensor, quartic",
        "quintic": "of the sensor, quintic",
        "drive": "of the drive",
        "drive_odd_quintic": "of the drive, odd quintic",
    },
)
