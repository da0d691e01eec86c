"""Backlash: play between what the piezo moves and what the sensor measures.

x₀ is the displacement before the play and x the one behind it, both in m, and w is the width in m:

    x ← min(max(x, x₀ - w/2), x₀ + w/2)

At first x lies in the middle of its play. Causes: a worn joint, a loose sample holder. Assumptions:
friction holds x while it is not pushed, and x is too light to act back on x₀.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.optimal_inverse import Kernel, OptimalInverse
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, amounts
from afm_scan_ros.core.types import Array

WIDTH = EffectParameter("width", "m", 0.0, 5e-6, 1e-12)
STEEPNESS = 100.0
CROSSING = 0.22
"""Of a period of the model's fastest mode: how long the play is crossed. A mean over so long halves
the power at twice that mode, and leaves the structure beyond, which no model knows, at rest."""
AHEAD = 1.0 / 3.0
"""Share of it before the turn. What still rings after the crossing pushes the sample on, and
nothing draws it back, so it is better to touch late than early."""


@compiled
def _apply(follower: float, half: float, block: Array, result: Array) -> float:
    for k in range(block.size):
        follower = min(max(follower, block[k] - half), block[k] + half)
        result[k] = follower
    return follower


@compiled
def _lead(state: Array, half: float, block: Array, lead: Array) -> None:
    ahead, last = state
    for k in range(block.size):
        ahead = min(max(ahead + STEEPNESS * (block[k] - last), -half), half)
        last = block[k]
        lead[k] = ahead
    state[:] = ahead, last


Crossing = tuple[Array, Array, Array]
"""State of the inverse, m: last lead and target (2,), the leads that the mean needs, and the
targets whose lead is not known yet."""


class Backlash:
    """Play of one width (m); the state is where the follower lies (m).

    The inverse leads by half the width, so at each reversal it has to cross the play. It would do
    so while its target moves by 1/STEEPNESS of the width: a jump would follow any rounding of a
    target at rest. Its lead is averaged over ``crossing`` samples, for a jump makes the structure
    ring; its error is how far the target moves in these, and that share of the width.
    """

    def __init__(self, width: float, crossing: int = 0) -> None:
        self._half = 0.5 * width
        values = np.full(crossing + 1, 1.0 / (crossing + 1))
        ahead = round(AHEAD * crossing)
        self._mean = OptimalInverse(Kernel(values, ahead), ahead)

    def at_rest(self) -> float:
        """Position of the follower in the middle."""
        return 0.0

    def apply(self, state: float, block: Array) -> tuple[float, Array]:
        """Displacement behind the play for that before it, both (n,) in m."""
        result = np.empty_like(block)
        return _apply(state, self._half, block, result), result

    def inverse_at_rest(self) -> Crossing:
        """State in the middle."""
        return np.zeros(2), self._mean.at_rest(), np.empty(0)

    def invert(self, state: Crossing, block: Array) -> tuple[Crossing, Array]:
        """Displacement before the play that gives ``block`` behind it, both in m."""
        turned, lead = state[0].copy(), np.empty_like(block)
        _lead(turned, self._half, block, lead)
        mean, known = self._mean.invert(state[1], lead)
        targets, waiting = np.split(np.concatenate((state[2], block)), [len(known)])
        return (turned, mean, waiting), targets + known

    def finish(self, state: Crossing) -> Array:
        """Return the samples still owed, as if the last lead were held."""
        return np.asarray(state[2] + self._mean.finish(state[1]))


def _crossed_in(width: float, time: float, sample_period: float) -> Backlash:
    return Backlash(width, round(time / sample_period))


def insert(chain: Chain, values: Array) -> Chain:
    """Put play before the sensor: width (m)."""
    (width,) = values
    fastest = np.abs(np.roots(chain.model.vibration.denominator)).max(initial=0.0)
    time = CROSSING * 2.0 * np.pi / fastest if fastest else 0.0
    return chain.with_output(Element(_crossed_in, (width, time)))


def starts(features: ResidualFeatures) -> Iterator[tuple[float]]:
    """Width that the residual shows if the play is small beside the motion, and a tenth of it."""
    little = 1e-3 * float(np.ptp(features.displacement))
    lag = Backlash(little).apply(0.0, features.displacement)[1] - features.displacement
    width = WIDTH.nearest(little * amounts(features.residual, lag)[0])
    yield (max(width, 1e-9),)
    yield (max(0.1 * width, 1e-10),)


@register
def backlash() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="backlash",
        equation="x follows x0 only when pushed, from +-width / 2 away",
        needs="reversals at several places and motions as small as the width",
        experiment="amplitudes",
        remedy="feedforward",
        advice="the drive crosses the play at every reversal, which requires a turnaround and a"
        " fast amplifier. An axis at rest may lie anywhere in its play",
        source="The play operator: A. Visintin, Differential Models of Hysteresis, Springer 1994.",
        inverse="The inverse crosses the play at each reversal within 0.22 of a period of the"
        " model's fastest mode. A third of the crossing lies before the turn. An immediate crossing"
        " would be a step, which excites modes that the model lacks. During a slower crossing the"
        " target moves on, so a slower turnaround reduces the error. `afm-scan bench play` prints"
        " the error.",
        confusable=("hysteretic_stiffness", "parameter_shift", "static_nonlinearity"),
        forms=(EffectForm("", ("output",), (WIDTH,), insert, starts, example=(5e-8,)),),
    )
