"""Drift: the scanner moves with time, driven or not.

With t from the start of the record, v in m/s and θ in s:

- exponential: x(t) = x₀(t) + v θ (1 - e^{-t/θ}), which begins at the rate v and settles with θ.
- logarithmic: x(t) = x₀(t) + v θ ln(1 + t/θ), of which the rate falls as 1/t and never vanishes.

Causes: thermal expansion of the frame after a change of temperature; a clamp, a glue or a coarse
approach that creeps logarithmically. Of a settling time longer than any record only the rate is
determined.
"""

from collections.abc import Callable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.base import Element, Recursion
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, amounts
from afm_scan_ros.core.types import Array

RATE = EffectParameter("rate", "m/s", -1e-5, 1e-5, 1e-13, own=True)
SETTLING = EffectParameter("settling", "s", 0.1, 1e5, 0.01, neutral=100.0)
"""Beyond, the drift of any record is a straight line."""
Course = Callable[[Array], Array]
"""Motion (n,) at times (n,), in units of the settling time and of what is moved in it at first."""


def settles(time: Array) -> Array:
    """An exponential."""
    return np.asarray(-np.expm1(-time))


@frozen
class Drift(Recursion):
    """Motion with time; the state is the index of the next sample."""

    course: Course
    rate: float
    settling: float
    sample_period: float

    def at_rest(self) -> int:
        """Index of the first sample."""
        return 0

    def run(self, state: int, block: Array, direction: float) -> tuple[int, Array]:
        """Index of the sample after a block, and displacement (m) with or without the drift."""
        after = state + len(block)
        age = self.sample_period * np.arange(state, after, dtype=np.float64)
        moved = self.rate * self.settling * self.course(age / self.settling)
        return after, block + direction * moved


def form(
    kind: str,
    course: Course,
    example: tuple[float, ...],
    text: str = "",
    refines: str | None = None,
) -> EffectForm:
    """Return the form of a drift with a time course."""

    def insert(chain: Chain, values: Array) -> Chain:
        """Let the output drift: rate (m/s), settling time (s)."""
        return chain.with_output(Element(Drift, (course, *values)))

    def starts(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
        """Settle within the record, or far beyond it, at the rate that the residual shows."""
        still = np.zeros_like(features.residual)
        for share in (0.05, 0.3, 3.0):
            settling = SETTLING.nearest(share * features.duration)
            moved = Drift(course, 1.0, settling, features.sample_period).apply(0, still)[1]
            yield RATE.nearest(amounts(features.residual, moved)[0]), settling

    where, what = ("output",), (RATE, SETTLING)
    return EffectForm(
        kind, where, what, insert, starts, example=example, text=text, refines=refines
    )


@register
def drift() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="drift",
        equation="x = x0 + rate settling (1 - exp(-t / settling)), or x0 + rate settling"
        " ln(1 + t / settling)",
        needs="a record that is long beside its smallest visible motion; best one at rest",
        experiment="rest",
        remedy="partly",
        advice="the inverse subtracts this drift, which is right only while the drift lasts. Let"
        " the instrument settle, or measure the drift again before each scan",
        source="Logarithmic creep: E. Orowan, J. West Scotland Iron Steel Inst. 54 (1946) 45.",
        inverse="The inverse subtracts the drift as a function of time.",
        confusable=("periodic_disturbance", "slow_creep"),
        forms=(
            form("", settles, text="exponential", example=(1e-7, 30.0)),
            form("logarithmic", np.log1p, example=(1e-7, 0.5), text="", refines=""),
        ),
    )
