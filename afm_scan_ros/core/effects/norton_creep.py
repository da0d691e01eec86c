"""Creep of which the rate rises by a power of the stress, in series with the scanner.

Equation (Norton): dz/dt = (x - z) (|x - z| / REACH)^(power - 1) / τ, and x + g z comes out: what
the joint still has to creep, x - z, is the stress in it. x and z in m, τ in s at a stress of REACH,
g dimensionless. Power 1 is a spring and a damper; dislocations that climb or drag atoms along have
3 to 7. Source: H. J. Frost, M. F. Ashby, Deformation-Mechanism Maps, Pergamon 1982, 2.4.

x is taken as held between samples, within which the stress e has a closed form,
e (1 + a s)^(-1/a) with a = power - 1 and s = (T/τ) (|e| / REACH)^a.
"""

import math

import numpy as np

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.effects.base import CausalInverse
from afm_scan_ros.core.types import Array

REACH = 10e-6  # m
LINEAR = 1e-9
"""Power above 1 below which the law is the linear one."""


@inlined
def _relaxed(stress: float, excess: float, pace: float) -> float:
    """Stress (m) that is left after a step; ``pace``: step over time constant."""
    if excess < LINEAR:
        return stress * math.exp(-pace)
    fast = pace * (abs(stress) / REACH) ** excess
    return stress * math.exp(-math.log1p(excess * fast) / excess)


@compiled
def _apply(z: float, law: tuple[float, float, float], block: Array, result: Array) -> float:
    gain, excess, pace = law
    for k in range(block.size):
        result[k] = block[k] + gain * z
        z = block[k] - _relaxed(block[k] - z, excess, pace)
    return z


@compiled
def _invert(z: float, law: tuple[float, float, float], block: Array, result: Array) -> float:
    gain, excess, pace = law
    for k in range(block.size):
        result[k] = block[k] - gain * z
        z = result[k] - _relaxed(result[k] - z, excess, pace)
    return z


class NortonCreep(CausalInverse):
    """Creep by a power of its stress; the state is z (m).

    The inverse solves each step of the discrete system for its input, so it is exact.
    """

    def __init__(self, gain: float, time_constant: float, power: float, period: float) -> None:
        self._law = gain, power - 1.0, period / time_constant

    def at_rest(self) -> float:
        """Nothing has crept."""
        return 0.0

    def apply(self, state: float, block: Array) -> tuple[float, Array]:
        """Displacement with what has crept, for displacement without, both (n,) in m."""
        result = np.empty(len(block))
        return _apply(state, self._law, block, result), result

    def inverse_at_rest(self) -> float:
        """Nothing has crept."""
        return 0.0

    def invert(self, state: float, block: Array) -> tuple[float, Array]:
        """Displacement without what creeps that gives ``block`` with it, both (n,) in m."""
        result = np.empty(len(block))
        return _invert(state, self._law, block, result), result
