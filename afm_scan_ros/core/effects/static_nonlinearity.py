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

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.diagnosis.clues import Clues
from afm_scan_ros.core.effects.amounts import amounts
from afm_scan_ros.core.effects.entry import Entry, Form, Parameter
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array

REACH, REACH_V = 40e-6, 5.0
"""m and V; as far as a scanner of this size goes."""
LEVELS = 2049
NEWTON_STEPS = 3
"""The table starts within 1 nm at worst; each step squares what is left, two reach rounding."""
EXACT = 1e-9
"""Share of the reach by which the inverse may miss a target: below any noise."""

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


class StaticNonlinearity:
    """A rising polynomial, with its inverse by Newton's method; nothing is remembered.

    ``coefficients`` (n,) are those of x₀⁰, x₀¹ and on. Raises InputError where it does not rise
    everywhere within the ``reach``, m or V.
    """

    def __init__(self, coefficients: Array, reach: float = REACH) -> None:
        self._coefficients, self._reach = coefficients, reach
        self._straight = np.linspace(-reach, reach, LEVELS)
        self._bent, slope = self._bend(self._straight)
        if slope.min() <= 0.0:
            raise InputError(
                "static_nonlinearity: with these coefficients the curve turns back at"
                f" {self._straight[slope.argmin()] / reach:.3g} of its reach, {reach:g}, so it has"
                " no inverse: choose smaller ones"
            )

    def at_rest(self) -> None:
        """Return no state."""

    def apply(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Displacement x of straight displacement x₀, both (n,) in m."""
        return None, self._bend(block)[0]

    def inverse_at_rest(self) -> None:
        """Return no state."""

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Straight displacement x₀ that gives x, both (n,) in m.

        Raises ScanError where Newton's method has not reached it, as of a target that is no number.
        """
        found = np.interp(block, self._bent, self._straight)
        for _ in range(NEWTON_STEPS):
            bent, slope = self._bend(found)
            found = found - (bent - block) / slope
        missed = ~(np.abs(self._bend(found)[0] - block) <= EXACT * self._reach)
        if missed.any():
            k = int(np.argmax(missed))
            raise ScanError(
                f"sample {k} of the block: static_nonlinearity has no inverse at {block[k]:.6g}"
                f" (m or V): keep within its reach, {self._reach:g}, or choose smaller coefficients"
            )
        return None, found

    def finish(self, state: None) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)

    def _bend(self, straight: Array) -> tuple[Array, Array]:
        bent, slope = np.empty_like(straight), np.empty_like(straight)
        _bend(self._coefficients, self._reach, straight, bent, slope)
        return bent, slope


def polynomial(parameters: Sequence[Parameter], values: Array) -> Array:
    """Coefficients of x₀⁰, x₀¹ and on, where those of some ``POWERS`` have values."""
    coefficients = np.zeros(1 + max(POWERS.values()))
    coefficients[[1, *(POWERS[p.name] for p in parameters)]] = 1.0, *values
    return coefficients


def form(kind: str, *parameters: Parameter, refines: str | None = None) -> Form:
    """Form of which the polynomial has these terms beyond the first."""

    def insert(chain: Chain, values: Array) -> Chain:
        """Bend the output."""
        bent = StaticNonlinearity(polynomial(parameters, values))
        return chain.with_output(lambda _: bent)

    def starts(clues: Clues) -> Iterator[tuple[float, ...]]:
        """Coefficients that the residual shows, its part along the displacement left out."""
        yield _seen(parameters, clues.residual, clues.displacement)

    return Form(kind, parameters, insert, starts, (0.0,) * len(parameters), refines)


def form_of_drive(kind: str, *parameters: Parameter) -> Form:
    """Form of which the polynomial bends the drive."""

    def insert(chain: Chain, values: Array) -> Chain:
        """Bend the drive."""
        bent = StaticNonlinearity(polynomial(parameters, values), REACH_V)
        return chain.with_drive(lambda _: bent)

    def starts(clues: Clues) -> Iterator[tuple[float, ...]]:
        """Coefficients that the residual shows, by the gain of the record as a whole."""
        moved = np.std(clues.displacement)
        volts = np.std(clues.drive) / moved * clues.residual if moved else clues.residual
        yield _seen(parameters, volts, clues.drive)

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
