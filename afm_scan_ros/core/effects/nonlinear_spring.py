"""Nonlinear spring: the stiffness of the structure changes with its deflection.

x₀ (m) is the displacement without the effect, x the one with it. The force f, in m as far as it
would move the resting structure, acts on the first resonance ω, ζ of the vibration:

    x = x₀ + u,    u'' + 2 ζ ω u' + ω² u = ω² f,    f = -(a x² + b x³)

So the restoring force is that of x + a x² + b x³ (Duffing's equation): a spring that hardens where
b > 0, as a flexure that is stretched, or softens where b < 0, as an electrostatic drive does; a is
that of a spring bent at rest. Displacement at rest and resonance depend on amplitude together, and
nothing is lost. Assumption: within a sample period T the force is its mean at both ends. The error
is of the order (ωT)².
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import Element, Recursion
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.vibration import Resonance, VibrationModel, first_resonance, held
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array

QUADRATIC, CUBIC = (
    EffectParameter("quadratic", "1/m", -2e4, 2e4, 0.04),
    EffectParameter("cubic", "1/m2", -1e9, 1e9, 2e3),
)


State = tuple[Array, float, float]
"""Of the resonance (2,), the last force f and the last x (m)."""


@compiled
def _run(
    system: tuple[Array, Array, Array],
    spring: tuple[float, float],
    state: State,
    block: Array,
    direction: float,
    result: Array,
) -> tuple[float, float]:
    """From x₀ to x by two of Newton's steps a sample, or from x to x₀ (-1); return last f and x."""
    (a, b, c), (inner, force, last), (square, cube) = system, state, spring
    pushed, (first, second) = c[0] * b[0] + c[1] * b[1], inner
    before = -(square * last**2 + cube * last**3)
    for k in range(block.size):
        ahead = a[0, 0] * first + a[0, 1] * second
        second = a[1, 0] * first + a[1, 1] * second
        free = c[0] * ahead + c[1] * second
        end = block[k]
        if direction > 0.0:
            end += free + pushed * before
            for _ in range(2):
                force = 0.5 * (before - square * end**2 - cube * end**3)
                slope = 1.0 + 0.5 * pushed * (2.0 * square * end + 3.0 * cube * end**2)
                end -= (end - block[k] - free - pushed * force) / slope
        after = -(square * end**2 + cube * end**3)
        force, before = 0.5 * (before + after), after
        first, second = ahead + b[0] * force, second + b[1] * force
        result[k] = end if direction > 0.0 else block[k] - free - pushed * force
        last = end
    inner[:] = first, second
    return force, last


class NonlinearSpring(Recursion):
    """What the spring of a resonance has beyond a straight line, in feedback on the displacement.

    The inverse knows x, so it runs the same loop along the target and subtracts u.
    """

    def __init__(
        self, resonance: Resonance, square: float, cube: float, sample_period: float
    ) -> None:
        system = held(VibrationModel(resonance.factor[-1:], resonance.factor), sample_period)
        self._system, self._spring = (system.a, system.b, system.c), (square, cube)

    def at_rest(self) -> State:
        """State at rest at zero."""
        return np.zeros(2), 0.0, 0.0

    def run(self, state: State, block: Array, direction: float) -> tuple[State, Array]:
        """State, and x for x₀ or x₀ for x (m); raises ScanError where x grows without bound."""
        inner, result = state[0].copy(), np.empty_like(block)
        moving = inner, *state[1:]
        ended = _run(self._system, self._spring, moving, block, direction, result)
        if direction > 0.0 and not np.isfinite(result).all():
            raise ScanError(
                "nonlinear_spring: with these coefficients the spring turns back within the"
                " motion: choose smaller ones"
            )
        return (inner, *ended), result


def insert(chain: Chain, values: Array) -> Chain:
    """Let the first resonance's spring bend: quadratic (1/m) and cubic (1/m²) part."""
    resonance = first_resonance(chain.model.vibration)
    return chain.with_output(Element(NonlinearSpring, (resonance, *map(float, values))))


def starts(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """A spring that adds a hundredth of the force at the largest deflection, either way."""
    reach = 0.5 * float(np.ptp(features.displacement))
    force = 0.01 / reach**2 if reach > 0.0 else 0.0
    for cube in (force, -force):
        yield 0.0, CUBIC.nearest(cube)


@register
def nonlinear_spring() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="nonlinear_spring",
        equation="x = x0 + u, u'' + 2 zeta w u' + w^2 u = -w^2 (quadratic x^2 + cubic x^3)",
        needs="the resonance driven at amplitudes that differ by a factor of two or more",
        experiment="amplitudes",
        remedy="feedforward",
        advice="the inverse knows the spring over the deflections that were measured, and"
        " extrapolates elsewhere",
        source="G. Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, Vieweg 1918;"
        " of a drive in electronics, T. Wigren and J. Schoukens, ECC 2013, pp. 2933-2938.",
        inverse="The feedback is evaluated along the target, which is known, and subtracted before"
        " the other inverses; there is no iteration.",
        confusable=("hysteretic_stiffness", "static_nonlinearity", "parameter_shift"),
        forms=(
            EffectForm(
                "",
                ("output",),
                (QUADRATIC, CUBIC),
                insert,
                starts,
                example=(1e3, 1e8),
            ),
        ),
    )
