"""Hysteretic stiffness: the structure is softer and loses more energy, the farther it moves.

x₀ (m) is the displacement without the effect, x the one with it. The force f, in m as far as it
would move the resting structure, acts on the first resonance ω, ζ of the vibration:

    x = x₀ + u,    u'' + 2 ζ ω u' + ω² u = ω² f,    f = Σ kᵢ (pᵢ(x) - b x)

The pᵢ are play elements (m): dry friction between domains, or in joints, in parallel with the
spring (Iwan's model). Σ kᵢ is the share k of the stiffness that yields, equal in all elements.
Their thresholds are distributed exponentially about the threshold r (m). The balance b is how much
of k the base model already counts as missing. It is 0 if that model was identified by motions far
below r, and near 1 if by motions far above. So resonance, displacement at rest and loss depend on
amplitude together. k and b are dimensionless.

The form `spectrum` leaves the distribution open: it has a share for each of four thresholds.
Between these the shares are linear in the logarithm of the threshold. Assumption: within a sample
period T all is linear in time. The error is of the order (ωT)².
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import Element, Recursion
from afm_scan_ros.core.effects.effect_type import (
    EffectForm,
    EffectParameter,
    EffectType,
    fixed,
    register,
)
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.scale import length_scale
from afm_scan_ros.core.effects.vibration import Resonance, VibrationModel, first_resonance, held
from afm_scan_ros.core.types import Array

SHARE = EffectParameter("share", "1", 0.0, 0.9, 1e-6)
THRESHOLD = EffectParameter("threshold", "m", 1e-10, 1e-4, 1e-11, neutral=1e-6)
BALANCE = EffectParameter("balance", "1", 0.0, 1.5, 1e-5)
ELEMENTS = 32
"""So many that the yielding of one by one shows no steps."""
SPREAD = -np.log(1.0 - (np.arange(ELEMENTS) + 0.5) / ELEMENTS)
"""Thresholds in units of their scale: quantiles of the exponential distribution."""
KNOTS = (0.5e-6, 2e-6, 8e-6, 32e-6)
"""Thresholds of a spectrum on the reference scanner, m.

What yields sooner is a loss alone, what yields later a spring."""
ALIKE = (0.02 / len(KNOTS),) * len(KNOTS)
"""Starts of the shares about the knots, which act all but linearly."""
SHARES = tuple(
    evolve(SHARE, name=f"share_{n}", upper=SHARE.upper / len(KNOTS))
    for n in range(1, 1 + len(KNOTS))
)


State = tuple[Array, Array, float, float]
"""Of the resonance (2,), of the plays (m), the last force f and the last x (m)."""


@compiled
def _run(
    system: tuple[Array, Array, Array],
    material: tuple[Array, Array, float],
    state: State,
    block: Array,
    direction: float,
    result: Array,
) -> tuple[float, float]:
    """From x₀ to x with ``direction`` 1, from x to x₀ with -1; return the last f and x."""
    (a, b, c), (inner, plays, force, last) = system, state
    thresholds, shares, missing = material
    pushed, (first, second) = c[0] * b[0] + c[1] * b[1], inner
    for k in range(block.size):
        ahead = a[0, 0] * first + a[0, 1] * second
        second = a[1, 0] * first + a[1, 1] * second
        free = c[0] * ahead + c[1] * second
        end = block[k] + free + pushed * force if direction > 0.0 else block[k]
        middle, total = 0.5 * (last + end), 0.0
        for i in range(plays.size):
            plays[i] = min(max(plays[i], middle - thresholds[i]), middle + thresholds[i])
            total += shares[i] * plays[i]
        force = total - missing * middle
        first, second = ahead + b[0] * force, second + b[1] * force
        result[k] = block[k] + direction * (free + pushed * force)
        last = result[k] if direction > 0.0 else block[k]
    inner[:] = first, second
    return force, last


class HystereticStiffness(Recursion):
    """What yields beside the spring of a resonance, in feedback on the displacement.

    ``material`` is (thresholds (m), kᵢ, b). The inverse knows x, so it runs the same loop along the
    target and subtracts u: exact but for the predicted end of each period.
    """

    def __init__(
        self, resonance: Resonance, material: tuple[Array, Array, float], sample_period: float
    ) -> None:
        system = held(VibrationModel(resonance.factor[-1:], resonance.factor), sample_period)
        self._system = system.a, system.b, system.c
        thresholds, shares, balance = material
        self._material = thresholds, shares, balance * float(shares.sum())

    def at_rest(self) -> State:
        """State at rest at zero, all plays in the middle."""
        return np.zeros(2), np.zeros(ELEMENTS), 0.0, 0.0

    def run(self, state: State, block: Array, direction: float) -> tuple[State, Array]:
        """State, and displacement x for x₀ or x₀ for x, both (n,) in m."""
        inner, plays, result = state[0].copy(), state[1].copy(), np.empty_like(block)
        moving = inner, plays, *state[2:]
        ended = _run(self._system, self._material, moving, block, direction, result)
        return (inner, plays, *ended), result


def insert(chain: Chain, values: Array) -> Chain:
    """Let the first resonance's spring yield: share, threshold (m), balance."""
    return _with_element(chain, _exponential, values)


def insert_spectrum(chain: Chain, values: Array) -> Chain:
    """Let it yield by shares of their own about each of the ``KNOTS``, and the balance."""
    return _with_element(chain, _of_spectrum, np.append(values, length_scale(chain.model)))


def spectrum(shares: Sequence[float], scale: float = 1.0) -> tuple[Array, Array]:
    """Thresholds (m) and shares of elements with such shares about the ``KNOTS`` of a ``scale``."""
    knots = np.log(scale * np.array(KNOTS))
    levels = np.linspace(knots[0], knots[-1], ELEMENTS)
    hats = np.stack([np.interp(levels, knots, peak) for peak in np.eye(len(KNOTS))])
    return np.exp(levels), shares @ (hats / hats.sum(axis=1, keepdims=True))


def _exponential(resonance: Resonance, *values: float) -> HystereticStiffness:
    share, threshold, balance, sample_period = values
    material = threshold * SPREAD, np.full(ELEMENTS, share / ELEMENTS), balance
    return HystereticStiffness(resonance, material, sample_period)


def _of_spectrum(resonance: Resonance, *values: float) -> HystereticStiffness:
    *shares, balance, scale, sample_period = values
    return HystereticStiffness(resonance, (*spectrum(shares, scale), balance), sample_period)


def _with_element(chain: Chain, make: Callable[..., HystereticStiffness], values: Array) -> Chain:
    resonance = first_resonance(chain.model.vibration)
    return chain.with_output(Element(make, (resonance, *values)))


def starts(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """Thresholds from far below the motion to about as large, each a minimum of its own.

    A base model counts nothing of what yields as missing, or all of it.
    """
    reach = 0.5 * float(np.ptp(features.displacement))
    for part, balance in product((0.05, 0.2, 0.8), (0.0, 1.0)):
        yield 0.02, THRESHOLD.nearest(part * reach), balance


@register
def hysteretic_stiffness() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="hysteretic_stiffness",
        equation="x = x0 + u, u'' + 2 zeta w u' + w^2 u = w^2 share (mean of plays around x"
        " - balance x), their thresholds exponentially distributed about threshold; or of plays"
        " with share_1, share_2 and on of it about thresholds of 2.3, 9, 36 and 145 % of the"
        " displacement at the largest drive",
        needs="the resonance driven at amplitudes that differ by a factor of three or more",
        experiment="amplitudes",
        remedy="feedforward",
        advice="the inverse knows stiffness and loss at the amplitudes that were measured, and"
        " extrapolates elsewhere",
        source="W. D. Iwan, J. Appl. Mech. 33 (1966) 893.",
        inverse="The feedback is evaluated along the target, which is known, and subtracted before"
        " the other inverses; there is no iteration.",
        confusable=("parameter_shift", "static_nonlinearity"),
        forms=(
            EffectForm(
                "",
                ("output",),
                (SHARE, THRESHOLD, BALANCE),
                insert,
                starts,
                example=(0.1, 3e-6, 0.3),
                text="one threshold",
            ),
            EffectForm(
                "spectrum",
                ("output",),
                (*SHARES, BALANCE),
                insert_spectrum,
                fixed(*((*ALIKE, balance) for balance in (0.0, 1.0))),
                example=(0.03, 0.04, 0.02, 0.01, 0.3),
                refines="",
            ),
        ),
    )
