"""Hysteretic stiffness: the structure is softer and loses more, the farther it moves.

Equations, with x₀ (m) what the axis would do, x what it does, and the force f, in m as far as it
would move the resting structure, acting on the first resonance ω, ζ of the vibration:

    x = x₀ + u,    u'' + 2 ζ ω u' + ω² u = ω² f,    f = k (Σ pᵢ(x) / N - b x)

pᵢ are play elements (m) of thresholds spread exponentially about the threshold r (m): dry friction
between domains, or in joints, in parallel with the spring (Iwan's model). k is the share of the
stiffness that yields. b is how much of it the base model counts as missing: 0 where that was
identified by motions far below r, towards 1 by motions far above, or without what yields. So
resonance, displacement at rest and loss depend on amplitude together. k and b are dimensionless.
In the form ``spread`` the thresholds have Weibull's distribution, exponential at the narrowness 1.
Assumption: within a sample period T all is straight; what is left out is of the order (ωT)².
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
from attrs import frozen

from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.catalogue.resonance import Resonance, first_resonance
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.vibration import VibrationModel, held
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

SHARE = Parameter("share", "1", 0.0, 0.9, 1e-6)
THRESHOLD = Parameter("threshold", "m", 1e-10, 1e-4, 1e-11)
BALANCE = Parameter("balance", "1", 0.0, 1.5, 1e-5)
NARROWNESS = Parameter("narrowness", "1", 0.3, 4.0, 1e-4)
EXPONENTIAL = 1.0
"""Narrowness (Weibull's modulus) of the exponential distribution."""
ELEMENTS = 32
"""So many that the yielding of one by one shows no steps."""
SPREAD = -np.log(1.0 - (np.arange(ELEMENTS) + 0.5) / ELEMENTS)
"""Thresholds in units of their scale: quantiles of the exponential distribution."""


@frozen(eq=False)
class Loop:
    """State: of the resonance ``inner`` (2,), the ``plays`` (m), last force f and last x (m)."""

    inner: Array
    plays: Array
    force: float
    last: float


@compiled
def _run(
    system: tuple[Array, Array, Array],
    material: tuple[Array, float, float],
    state: tuple[Array, Array, float, float],
    block: Array,
    direction: float,
    result: Array,
) -> tuple[float, float]:
    """From x₀ to x with ``direction`` 1, from x to x₀ with -1; return the last f and x.

    Each period has the force at its middle. Its end is foretold by the last force, forwards.
    """
    (a, b, c), (inner, plays, force, last) = system, state
    thresholds, share, balance = material
    pushed, (first, second) = c[0] * b[0] + c[1] * b[1], inner
    for k in range(block.size):
        ahead = a[0, 0] * first + a[0, 1] * second
        second = a[1, 0] * first + a[1, 1] * second
        free = c[0] * ahead + c[1] * second
        end = block[k] + free + pushed * force if direction > 0.0 else block[k]
        middle, total = 0.5 * (last + end), 0.0
        for i in range(plays.size):
            plays[i] = min(max(plays[i], middle - thresholds[i]), middle + thresholds[i])
            total += plays[i]
        force = share * (total / plays.size - balance * middle)
        first, second = ahead + b[0] * force, second + b[1] * force
        result[k] = block[k] + direction * (free + pushed * force)
        last = result[k] if direction > 0.0 else block[k]
    inner[:] = first, second
    return force, last


class HystereticStiffness:
    """What yields beside the spring of a resonance, in feedback on the displacement.

    ``material`` is (thresholds (m), k, b). The inverse knows x, so it runs the same loop along the
    target and takes u off: it is exact but for the end of each period foretold, as above.
    """

    def __init__(
        self,
        resonance: Resonance,
        material: tuple[Array, float, float],
        sample_period: float,
    ) -> None:
        system = held(VibrationModel(resonance.factor[-1:], resonance.factor), sample_period)
        self._system = system.a, system.b, system.c
        self._material = material

    def at_rest(self) -> Loop:
        """State at rest at zero, all plays in the middle."""
        return Loop(np.zeros(2), np.zeros(ELEMENTS), 0.0, 0.0)

    def apply(self, state: Loop, block: Array) -> tuple[Loop, Array]:
        """Displacement x for a block of x₀, both (n,) in m."""
        return self._ran(state, block, 1.0)

    def inverse_at_rest(self) -> Loop:
        """State at rest at zero."""
        return self.at_rest()

    def invert(self, state: Loop, block: Array) -> tuple[Loop, Array]:
        """Displacement x₀ that gives a block of x, both (n,) in m."""
        return self._ran(state, block, -1.0)

    def finish(self, state: Loop) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)

    def _ran(self, state: Loop, block: Array, direction: float) -> tuple[Loop, Array]:
        inner, plays, result = state.inner.copy(), state.plays.copy(), np.empty_like(block)
        moving = inner, plays, state.force, state.last
        ended = _run(self._system, self._material, moving, block, direction, result)
        return Loop(inner, plays, *ended), result


def insert(chain: Chain, values: Array) -> Chain:
    """Let the first resonance's spring yield: share, threshold (m), balance."""
    return insert_spread(chain, np.append(values, EXPONENTIAL))


def insert_spread(chain: Chain, values: Array) -> Chain:
    """Let it yield by thresholds of another spread: share, threshold (m), balance, narrowness."""
    share, threshold, balance, narrowness = values
    resonance = first_resonance(chain.model.vibration)
    material = threshold * SPREAD ** (1.0 / narrowness), share, balance
    return chain.with_output(lambda period: HystereticStiffness(resonance, material, period))


def starts(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """Thresholds from far below the motion to about as large, each a minimum of its own.

    A base model counts nothing of what yields as missing, or all of it; what lies between fits
    any threshold half, and leads away from the true one.
    """
    reach = 0.5 * float(np.ptp(clues.displacement))
    for part, balance in product((0.05, 0.2, 0.8), (0.0, 1.0)):
        yield 0.02, THRESHOLD.nearest(part * reach), balance


def spread_starts(clues: Clues) -> Iterator[tuple[float, float, float, float]]:
    """The same, spread exponentially."""
    for start in starts(clues):
        yield (*start, EXPONENTIAL)


ENTRY = Entry(
    name="hysteretic_stiffness",
    equation="x = x0 + u, u'' + 2 zeta w u' + w^2 u = w^2 share (mean of plays around x"
    " - balance x), their thresholds threshold E^(1 / narrowness), E exponentially distributed with"
    " mean 1, the narrowness 1 where it is not named",
    needs="the resonance driven at amplitudes that differ by a factor of three or more",
    confusable=("backlash", "extra_resonance", "parameter_shift", "static_nonlinearity"),
    experiment="amplitudes",
    remedy="feedforward",
    advice="the inverse knows stiffness and loss at each amplitude; away from those that were"
    " measured it extrapolates",
    forms=(
        Form("", (SHARE, THRESHOLD, BALANCE), insert, starts, (0.0, 1e-6, 0.0)),
        Form(
            "spread",
            (SHARE, THRESHOLD, BALANCE, NARROWNESS),
            insert_spread,
            spread_starts,
            (0.0, 1e-6, 0.0, EXPONENTIAL),
            refines="",
        ),
    ),
)
