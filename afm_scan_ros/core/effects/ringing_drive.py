"""A drive that rings: the piezo's voltage swings about the converter's before it settles.

Equation: (P/2π)² v'' + 2 ζ (P/2π) v' + v = u, before the hysteresis; P in s is the period of the
ringing without its damping ζ, u and v in V. Source: an amplifier's loop with little phase margin,
the piezo's capacitance behind its output resistance.

What follows takes v as held between updates, so it gets v's mean over each hold, exactly: with the
pole p = (j √(1 - ζ²) - ζ) 2π/P, z = e^{pT}, r = -(1 - j ζ/√(1 - ζ²)) and c = r (z - 1) / (pT)

    v = u + (1 - q) (Re c - q Re(c z*)) / (1 - 2 q Re z + q² |z|²) u,    q a delay by T
"""

import math

import numpy as np
import scipy

from afm_scan_ros.core.effects.base import CausalInverse
from afm_scan_ros.core.types import Array


def held_ring(period: float, damping: float, sample_period: float) -> tuple[Array, Array]:
    """Numerator and denominator (3,) each in powers of q, from a hold to v's mean over it."""
    if period == 0.0:
        return np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    root = math.sqrt(1.0 - damping**2)
    turn = complex(-damping, root) * 2.0 * np.pi * sample_period / period
    z = np.exp(turn)
    c = complex(-1.0, damping / root) * (z - 1.0) / turn
    denominator = np.array([1.0, -2.0 * z.real, abs(z) ** 2])
    away = np.convolve([1.0, -1.0], [c.real, -(c * z.conjugate()).real])
    return denominator + away, denominator


class RingingDrive(CausalInverse):
    """Second-order lag that rings; the state is the filter's (2,).

    From v to u the numerator's zeros are those of a spline, one of them outside the unit circle:
    its inverse would grow. It is a smooth hump, of which the inverse undoes place and width by the
    parabola through three samples: exact up to second order in ωT, and it never rings. The
    inverse's state is the last four samples of v (V).
    """

    def __init__(self, period: float, damping: float, sample_period: float) -> None:
        self._numerator, self._denominator = held_ring(period, damping, sample_period)
        total = self._numerator.sum()
        mean, square = (self._numerator @ np.arange(3.0) ** power / total for power in (1, 2))
        last = mean**2 + 0.5 * (mean - square)
        weights = np.array([1.0 + mean + last, -mean - 2.0 * last, last])
        self._inverse = np.convolve(self._denominator / total, weights)

    def at_rest(self) -> Array:
        """State of a scanner that has long rested at zero."""
        return np.zeros(2)

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Mean voltage v on the piezo during each hold, for voltages u held, both (n,)."""
        if not block.size:  # of which lfilter makes up a state
            return state, block
        found, state = scipy.signal.lfilter(self._numerator, self._denominator, block, zi=state)
        return state, found

    def inverse_at_rest(self) -> Array:
        """Four samples before the first, at rest."""
        return np.zeros(4)

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Voltages u to hold for mean voltages v, both (n,)."""
        known = np.concatenate((state, block))
        found = np.convolve(known, self._inverse)[4 : len(known)]
        return known[-4:].copy(), found
