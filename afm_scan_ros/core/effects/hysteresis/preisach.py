"""Hysteresis by the Preisach model, in the numerical form that needs no differentiation.

Equation: Croft, Shed and Devasia (2001), Eqs. 12 to 17, from the input u (V) to the effective
input F (V). Eq. 17 summed along the staircase is, link by link, a branch that starts at the last
extremum (v, f): F = f + 2 E(u, v) rising, F = f - 2 E(v, u) falling. An input that passes the
last opposite extremum wipes out both and continues on the branch below.
Assumptions: independent of rate; minor loops between equal inputs are congruent.
"""

from collections.abc import Callable

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, refuse_beyond
from afm_scan_ros.core.effects.hysteresis.walk import drive, respond
from afm_scan_ros.core.types import Array

DEPOLARISING_CYCLES = 200


@frozen(eq=False)
class Memory:
    """What the material remembers: the extrema not yet wiped out, and the present.

    ``extrema``, shape (2, depth), holds inputs and outputs (V); the first is a minimum (the
    negative saturation) and they alternate. ``now``, shape (2,), is the last sample's pair.
    """

    extrema: Array
    now: Array


def depolarising(lower: float, upper: float) -> Array:
    """Inputs at the extrema of an oscillation that decays from both limits to zero."""
    decay = 1.0 - np.arange(DEPOLARISING_CYCLES + 1) / DEPOLARISING_CYCLES
    return np.outer(decay, [upper, lower]).ravel()


class Preisach:
    """Hysteresis of one axis, with its exact inverse; the state of either is the Memory.

    The inverse walks the same stack by output and solves one cell of the surface, so it gives
    back every output in range up to rounding. Samples beyond the surface raise BeyondRangeError.
    """

    def __init__(self, surface: EverettSurface) -> None:
        self.surface = surface
        self._grid = (surface.lower, float(surface.levels[1] - surface.levels[0]))
        self._tables = np.stack((surface.values.T, surface.values[::-1, ::-1]))

    def saturated(self) -> Memory:
        """Memory after an excursion to the lower limit, which wipes out everything else."""
        now = np.array([self.surface.lower, self.surface.offset])
        return Memory(now[:, np.newaxis], now)

    def at_rest(self) -> Memory:
        """Memory after an oscillation from both limits that decayed to zero."""
        oscillation = depolarising(self.surface.lower, self.surface.upper)
        return self.apply(self.saturated(), oscillation)[0]

    def apply(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        refuse_beyond(block, self.surface.lower, self.surface.upper)
        return self._walk(respond, state, block)

    def inverse_at_rest(self) -> Memory:
        """Memory of the inverse: the same material, depolarised."""
        return self.at_rest()

    def invert(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        refuse_beyond(block, self.surface.output_lower, self.surface.output_upper)
        return self._walk(drive, state, block)

    def finish(self, state: Memory) -> Array:  # noqa: ARG002 - this inverse never looks ahead
        """Return nothing: no sample is ever owed."""
        return np.empty(0)

    def _walk(
        self, kernel: Callable[..., int], state: Memory, block: Array
    ) -> tuple[Memory, Array]:
        stack = np.hstack((state.extrema, np.empty((2, len(block)))))
        now, result = state.now.copy(), np.empty_like(block)
        depth = state.extrema.shape[1]
        depth = kernel(self._tables, self._grid, stack, depth, now, block, result)
        return Memory(stack[:, :depth].copy(), now), result
