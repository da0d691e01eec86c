"""Hysteretic stiffness: the structure is softer and loses more, the farther it moves.

Equation, with e (m) the elongation of the first resonance under the effective input F, in units of
G(0) F so that both are equal at rest, and x what the rest of G makes of e:

    e'' + 2 ζ ω e' + ω² e = ω² (G(0) F + k (Σ pᵢ(e) / N - b e))

pᵢ are play elements (m) of thresholds spread exponentially about the threshold r (m): the force
of dry friction between domains, or in joints, in parallel with the spring (Iwan's model). k is
the share of the stiffness that yields. b is how much of it the base model counts as missing: 0
where that was identified by motions far below r, towards 1 by motions far above. So resonance,
gain at rest and loss depend on amplitude together. k and b are dimensionless.
Assumption: the elongation changes little within half a sample, by which the state is carried on
linearly, so that no delay is in the loop.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.catalogue.resonance import first_resonance
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.vibration import InverseDesign, Vibration, VibrationModel, held
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

SHARE = Parameter("share", "1", 0.0, 0.9, 1e-6)
THRESHOLD = Parameter("threshold", "m", 1e-10, 1e-4, 1e-11)
BALANCE = Parameter("balance", "1", 0.0, 1.0, 1e-5)
ELEMENTS = 8
SPREAD = -np.log(1.0 - (np.arange(ELEMENTS) + 0.5) / ELEMENTS)
"""Thresholds in units of their scale: quantiles of the exponential distribution."""


@frozen(eq=False)
class Loop:
    """State: that of the sampled system, inputs still delayed (V), plays (m), last force (V)."""

    inner: Array
    waiting: Array
    plays: Array
    force: float


Material = tuple[Array, float, float]
"""What yields: thresholds (m), shape (ELEMENTS,), strength (V per m), balance."""


@compiled
def _run(
    system: tuple[Array, Array, Array, Array],
    sight: tuple[Array, float],
    material: Material,
    state: tuple[Array, Array, float],
    block: tuple[Array, float],
    inputs: Array,
    outputs: Array,
) -> float:
    """Run the loop; ``block`` is what drives it (V), and how much of the feedback that contains.

    That share is 0 for inputs and 1 for total forces; ``inputs`` (V) and ``outputs`` (m) are found
    either way. The last total force is returned. One function, as calls with arrays cost more.
    """
    (a, by_input, by_feedback, c), (seen, at_once) = system, sight
    (thresholds, strength, balance), (inner, plays, force), (given, share) = material, state, block
    before = np.empty_like(inner)
    for k in range(given.size):
        elongation, outputs[k], total = at_once * force, 0.0, 0.0
        for i in range(inner.size):
            elongation += seen[i] * inner[i]
            outputs[k] += c[i] * inner[i]
        for i in range(plays.size):
            plays[i] = min(max(plays[i], elongation - thresholds[i]), elongation + thresholds[i])
            total += plays[i]
        feedback = strength * (total / plays.size - balance * elongation)
        inputs[k] = given[k] - share * feedback
        force = inputs[k] + feedback
        before[:] = inner
        for i in range(inner.size):
            new = by_input[i] * inputs[k] + by_feedback[i] * feedback
            for j in range(inner.size):
                new += a[i, j] * before[j]
            inner[i] = new
    return force


class HystereticStructure:
    """Vibration with a loop around its first resonance; the state is a Loop.

    The inverse takes the total force from the optimal inverse of G, runs the loop's elongation
    under it, and takes off what is fed back: as exact as the optimal inverse is. Raises InputError
    where G has no resonance.
    """

    def __init__(
        self,
        model: VibrationModel,
        sample_period: float,
        design: InverseDesign | None,
        material: Material,
    ) -> None:
        self._linear = Vibration(model, sample_period, design)
        mode = first_resonance(model)
        elongation = VibrationModel(
            model.static_gain * mode.omega**2 * mode.rest, model.denominator
        )
        half = held(elongation, 0.5 * sample_period)
        self._sight = half.c @ half.a, float(half.c @ half.b)
        self._prompt, self._system = held(elongation, sample_period), held(model, sample_period)
        self._material = material

    def at_rest(self) -> Loop:
        """State at rest at zero, all plays in the middle."""
        order, waiting = len(self._system.b), np.zeros(self._system.delay)
        return Loop(np.zeros(order), waiting, np.zeros(ELEMENTS), 0.0)

    def apply(self, state: Loop, block: Array) -> tuple[Loop, Array]:
        """Displacement (m) under a block of held inputs (V), both (n,)."""
        system, prompt = self._system, self._prompt
        extra = len(system.b) - len(prompt.b)  # the state of a delay by part of a sample
        matrices = system.a, system.b, np.pad(prompt.b, (0, extra)), system.c
        sight = np.pad(self._sight[0], (0, extra)), self._sight[1]
        known = np.concatenate((state.waiting, block))
        after, _, outputs = self._ran(matrices, sight, state, (known[: len(block)], 0.0))
        return evolve(after, waiting=known[len(block) :]), outputs

    def inverse_at_rest(self) -> tuple[Array, Loop]:
        """State of the optimal inverse, and of the loop without delay."""
        rest = Loop(np.zeros(len(self._prompt.b)), np.empty(0), np.zeros(ELEMENTS), 0.0)
        return self._linear.inverse_at_rest(), rest

    def invert(self, state: tuple[Array, Loop], block: Array) -> tuple[tuple[Array, Loop], Array]:
        """Inputs (V) whose displacement follows the targets ``block`` (m), delayed by preview."""
        ahead, totals = self._linear.invert(state[0], block)
        loop, inputs = self._taken_off(state[1], totals)
        return (ahead, loop), inputs

    def finish(self, state: tuple[Array, Loop]) -> Array:
        """Inputs still owed, the last target being held."""
        return self._taken_off(state[1], self._linear.finish(state[0]))[1]

    def _taken_off(self, state: Loop, totals: Array) -> tuple[Loop, Array]:
        """Inputs (V) that have the total forces (V), both (n,)."""
        prompt = self._prompt
        matrices = prompt.a, prompt.b, prompt.b, prompt.c
        return self._ran(matrices, self._sight, state, (totals, 1.0))[:2]

    def _ran(
        self,
        matrices: tuple[Array, Array, Array, Array],
        sight: tuple[Array, float],
        state: Loop,
        block: tuple[Array, float],
    ) -> tuple[Loop, Array, Array]:
        moving = state.inner.copy(), state.plays.copy(), state.force
        inputs, outputs = np.empty_like(block[0]), np.empty_like(block[0])
        force = _run(matrices, sight, self._material, moving, block, inputs, outputs)
        return Loop(moving[0], state.waiting, moving[1], force), inputs, outputs


def insert(chain: Chain, values: Array) -> Chain:
    """Let the first resonance's spring yield: share, threshold (m), balance."""
    share, threshold, balance = values

    def structure(
        model: VibrationModel, sample_period: float, design: InverseDesign | None
    ) -> HystereticStructure:
        material = threshold * SPREAD, share / model.static_gain, balance
        return HystereticStructure(model, sample_period, design, material)

    return evolve(chain, structure=structure)


def starts(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """Thresholds far below the motion and about as large, for a model of small or large ones."""
    reach = 0.5 * float(np.ptp(clues.displacement))
    for part, balance in product((0.1, 1.0), (0.1, 0.9)):
        yield 0.02, THRESHOLD.nearest(part * reach), balance


ENTRY = Entry(
    name="hysteretic_stiffness",
    equation="e'' + 2 zeta w e' + w^2 e = w^2 (G(0) F + share (mean of plays of threshold around"
    " e - balance e))",
    needs="the resonance driven at amplitudes that differ by a factor of three or more",
    confusable=("backlash", "extra_resonance", "parameter_shift", "static_nonlinearity"),
    experiment="amplitudes",
    remedy="feedforward",
    advice="the inverse knows stiffness and loss at each amplitude; away from those that were"
    " measured it extrapolates",
    forms=(Form("", (SHARE, THRESHOLD, BALANCE), insert, starts, (0.0, 1e-6, 0.0)),),
)
