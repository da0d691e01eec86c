"""Static nonlinearity: the displacement is a nonlinear function of itself.

    x = x₀ + a x₀² + b x₀³ + c x₀⁴ + d x₀⁵

The unit of a is 1/m, that of b is 1/m² and so on. The forms of the drive have the same polynomial
before the hysteresis, in 1/V and so on. Causes: a nonlinear sensor, the geometry of a lever
or a flexure; an amplifier near its rails. The first two terms often suffice; a symmetric cause has
the odd ones alone. Assumption: the output depends on the present input alone. The polynomial holds
within 1.8 times the model's displacement or 1.25 times its drive, where it must rise everywhere;
beyond, it goes on straight.

To a coupled structure are added squares and cubes of each drive and of each elongation, as by
springs that stiffen.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import LEVELS, StatelessEffect, solved
from afm_scan_ros.core.effects.effect_type import (
    Actuators,
    EffectForm,
    EffectParameter,
    EffectType,
    FeedbackForm,
    register,
)
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, amounts
from afm_scan_ros.core.effects.scale import length_scale, voltage_scale
from afm_scan_ros.core.errors import InputError, SampleError
from afm_scan_ros.core.types import Array, floats

REACH, REACH_V = 40e-6, 5.0
"""m and V: 1.8 times the displacement and 1.25 times the drive of the reference scanner."""
EXACT = 1e-9
"""Share of the reach by which the inverse may miss a target: below any noise."""

QUADRATIC = EffectParameter("quadratic", "1/m", -4e3, 4e3, 1.0)
CUBIC = EffectParameter("cubic", "1/m2", -1.6e8, 3e8, 1e4)
QUARTIC = EffectParameter("quartic", "1/m3", -8e12, 8e12, 1e8)
QUINTIC = EffectParameter("quintic", "1/m4", -4e17, 4e17, 1e13)
QUADRATIC_V = EffectParameter("quadratic", "1/V", -0.04, 0.04, 1e-6)
CUBIC_V = EffectParameter("cubic", "1/V2", -0.012, 0.02, 1e-7)
QUINTIC_V = EffectParameter("quintic", "1/V4", -1.6e-3, 1.6e-3, 1e-8)
SENSOR = {QUADRATIC: 1e3, CUBIC: 1e7}
ODD_V = {CUBIC_V: -4e-3, QUINTIC_V: 2e-5}
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
    """A polynomial from x₀⁰ on; InputError unless it rises within its ``reach`` (m or V)."""

    coefficients: tuple[float, ...] = field(converter=floats)
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
        """Straight displacement for x, or volts, (n,); SampleError unless Newton has converged."""
        found = solved(self._bend, self._straight, self._bent, outputs)
        missed = ~(np.abs(self._bend(found)[0] - outputs) <= EXACT * self.reach)
        if missed.any():
            sample = int(np.argmax(missed))
            raise SampleError(
                sample,
                f"static_nonlinearity has no inverse at {outputs[sample]:.6g} (m or V): keep within"
                f" its reach, {self.reach:g}, or choose smaller coefficients",
            )
        return found

    def _bend(self, straight: Array) -> tuple[Array, Array]:
        bent, slope = np.empty_like(straight), np.empty_like(straight)
        _bend(np.array(self.coefficients), self.reach, straight, bent, slope)
        return bent, slope


def polynomial(parameters: Sequence[EffectParameter], values: Array) -> Array:
    """Coefficients of x₀⁰, x₀¹ and on, where those of some ``POWERS`` have values."""
    found = np.zeros(1 + max(POWERS.values()))
    found[[1, *(POWERS[p.name] for p in parameters)]] = 1.0, *values
    return found


Terms = dict[EffectParameter, float]
"""Coefficients of a polynomial, with values of a size that a scanner may show."""


def form(kind: str, text: str, terms: Terms, place: str = "output") -> EffectForm:
    """Form of which the polynomial has these terms beyond the first."""
    parameters = tuple(terms)

    def insert(chain: Chain, values: Array) -> Chain:
        """Bend the output, or the drive."""
        coefficients = polynomial(parameters, values)
        if place == "drive":
            reach = REACH_V * voltage_scale(chain.model)
            return chain.with_drive(StaticNonlinearity(coefficients, reach))
        reach = REACH * length_scale(chain.model)
        return chain.with_output(StaticNonlinearity(coefficients, reach))

    def starts(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
        """Coefficients that the residual shows, its part along the displacement left out.

        In volts it is the residual by the gain of the record as a whole.
        """
        x, residual = features.displacement, features.residual
        if place == "drive":
            moved, x = np.std(x), features.drive
            residual = np.std(x) / moved * residual if moved else residual
        _, *found = amounts(residual, x, *(x ** POWERS[p.name] for p in parameters))
        yield tuple(p.nearest(each) for p, each in zip(parameters, found, strict=True))

    example, refines = tuple(terms.values()), "" if kind else None
    return EffectForm(
        kind, (place,), parameters, insert, starts, example=example, text=text, refines=refines
    )


@frozen
class Powers:
    """Square and cube of each drive and of each elongation."""

    actuators: Actuators

    def added(self, drive: Array, output: Array, run: int) -> Array:  # noqa: ARG002 - feedback's
        """Return the squares, then the cubes: (n, 4 m)."""
        both = np.hstack([self.actuators.scaled(drive), self.actuators.elongations(output)])
        return np.hstack([both**2, both**3])


@register
def static_nonlinearity() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="static_nonlinearity",
        equation="x = x0 + quadratic x0^2 + cubic x0^3 + quartic x0^4 + quintic x0^5, or the same"
        " of u",
        needs="large and small motion, about more than one place",
        experiment="amplitudes",
        remedy="feedforward",
        advice="if the sensor is nonlinear, the true motion is straight only once the sensor is"
        " corrected: compare with a grating",
        source="Mapping error of a position sensor: A. J. Fleming, Sensors and Actuators A 190"
        " (2013) 106.",
        inverse="Newton's method from a table, exact up to rounding.",
        confusable=("parameter_shift",),
        forms=(
            form("", "of the sensor", SENSOR),
            form("odd", "of the sensor, odd", {CUBIC: 1e8}),
            form("odd_quintic", "of the sensor, odd quintic", {CUBIC: 1e8, QUINTIC: 1e17}),
            form("quartic", "of the sensor, quartic", {**SENSOR, QUARTIC: 1e11}),
            form("quintic", "of the sensor, quintic", {**SENSOR, QUARTIC: 1e11, QUINTIC: 3e15}),
            form("drive", "of the drive", {QUADRATIC_V: 0.01, CUBIC_V: -2e-3}, "drive"),
            form("drive_odd_quintic", "of the drive, odd quintic", ODD_V, "drive"),
        ),
        feedback=FeedbackForm((), lambda _: (), lambda actuators, _: (Powers(actuators),)),
    )
