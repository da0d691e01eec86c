"""What has changed in an axis, and the reference filtered by the inverse of it.

The scanner's displacement is m times that of its model, with the gain's factor g and the first
resonance N(s) = s² + 2 ζ ω s + ω², whose frequency and damping have the factors f and d:

    m(s) = g f² N(s) / N'(s),    N'(s) = s² + 2 d ζ f ω s + f² ω²

Its inverse is affine in three coefficients of fixed filters, because N is the model's own:

    1/m = (1/g) (1 + a s²/N + b 2 ζ ω s/N),    a = 1/f² - 1,    b = d/f - 1

Slow creep adds c z behind the model's creep: z follows the displacement x0 (m) without it,
τ dz/dt + z = x0, with the slowest time constant τ of the model.

The inverse of the model then drives the changed scanner to the trajectory that it drives the
unchanged scanner to. So the weight of the optimal inverse, and all limits, stay as they are.

The filters' states do not depend on the parameters of gain and resonance. So a cross-fade of their
weights is the cross-fade of the outputs of two filters that run side by side.
"""

from math import expm1, inf
from typing import TypeAlias

import numpy as np
from attrs import astuple, evolve, frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.parameter_shift import GAIN, RESONANCE
from afm_scan_ros.core.effects.slow_creep import GAIN as CREEP_GAIN
from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added, AxisModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array

BOUNDS = (*GAIN, *RESONANCE, CREEP_GAIN)
"""Bounds of g, f, d and c: those of the effects ``parameter_shift`` and ``slow_creep``."""


@frozen
class AxisShift:
    """Factors on an axis' gain and on its first resonance's frequency and damping, and c."""

    gain: float = 1.0
    frequency: float = 1.0
    damping: float = 1.0
    creep: float = 0.0

    @classmethod
    def of(cls, unknowns: Array) -> "AxisShift | None":
        """Return the shift of (g - 1, a, b, c); None outside the catalogue's bounds."""
        change, alpha, beta, creep = (float(each) for each in unknowns)
        if alpha <= -1.0:
            return None
        frequency = (1.0 + alpha) ** -0.5
        found = cls(1.0 + change, frequency, frequency * (1.0 + beta), creep)
        pairs = zip(BOUNDS, astuple(found), strict=True)
        return found if all(bound.lower < value < bound.upper for bound, value in pairs) else None

    @property
    def loss(self) -> float:
        """Factor on the damping ratio over that on the frequency; 1 under an added mass."""
        return self.damping / self.frequency

    @property
    def unknowns(self) -> Array:
        """Return (g - 1, a, b, c)."""
        alpha, beta = self.frequency**-2 - 1.0, self.loss - 1.0
        return np.array([self.gain - 1.0, alpha, beta, self.creep])

    @property
    def weights(self) -> Array:
        """Weights (4,) of the reference, of its two filtered parts, and of slow creep."""
        _, alpha, beta, creep = self.unknowns
        return np.array([1.0 / self.gain, alpha / self.gain, beta / self.gain, creep])


def room() -> Array:
    """Distance of (g - 1, a, b, c) from 0 to the nearest bound, shape (4,)."""
    gain, frequency, damping, creep = BOUNDS
    alpha = min(1.0 - frequency.upper**-2, frequency.lower**-2 - 1.0)
    return np.array([1.0 - gain.lower, alpha, 1.0 - damping.lower, -creep.lower])


def with_shift(axis: AxisModel, shift: AxisShift) -> AxisModel:
    """Return the model of an axis with a shift added, each part of it as the catalogue's effect.

    Raises InputError where the model has no resonance that has changed.
    """
    added = []
    if shift.gain != 1.0:
        added.append(Added("parameter_shift", "gain", (shift.gain,)))
    if (shift.frequency, shift.damping) != (1.0, 1.0):
        added.append(Added("parameter_shift", "resonance", (shift.frequency, shift.damping)))
    if shift.creep != 0.0:
        added.append(Added("slow_creep", "", (shift.creep, slowest(axis))))
    return evolve(axis, added=(*axis.added, *added))


def slowest(axis: AxisModel) -> float:
    """Slowest time constant (s) of creep; infinite, so that nothing creeps, without creep."""
    return max(axis.creep.time_constants, default=inf)


class ResonanceParts:
    """The parts s²/N and 2 ζ ω s/N of a signal, N being the model's first resonance.

    The bilinear transform, exact at the resonance (A. V. Oppenheim and R. W. Schafer, Discrete-Time
    Signal Processing, section 7.1). The state is the last two values behind 1/N, shape (2,).
    Raises InputError for a resonance from the Nyquist frequency on.
    """

    def __init__(self, axis: AxisModel, sample_period: float) -> None:
        found = first_resonance(chain_of(axis).model.vibration)
        if (angle := 0.5 * found.omega * sample_period) >= np.pi / 2.0:
            raise InputError(
                f"the model's resonance at {found.frequency:g} Hz is not below half the sample rate"
                f" of {1.0 / sample_period:g} Hz: adapt at a higher sample rate"
            )
        rate = found.omega / np.tan(angle)
        second = rate**2 * np.array([1.0, -2.0, 1.0])
        first = 2.0 * found.damping * found.omega * rate * np.array([1.0, 0.0, -1.0])
        below = second + first + found.omega**2 * np.array([1.0, 2.0, 1.0])
        self._below, self._above = below / below[0], np.stack([second, first]) / below[0]

    def at_rest(self) -> Array:
        """State of a signal that has long been zero."""
        return np.zeros(2)

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Both parts, shape (2, n), of a block (n,)."""
        state, result = state.copy(), np.empty((2, len(block)))
        _parts(self._below, self._above, state, block, result)
        return state, result


class SlowSection:
    """Slow creep behind a model's own, at a gain of 1; the state is its output z, m."""

    def __init__(self, axis: AxisModel, sample_period: float) -> None:
        self._decay = expm1(-sample_period / slowest(axis))

    def at_rest(self) -> float:
        """Nothing has crept."""
        return 0.0

    def without(self, state: float, target: Array, gain: Array) -> tuple[float, Array, Array]:
        """Return the state, the target (m) less ``gain`` times z, and z (m), all (n,).

        With that much creep behind it, a scanner then follows the target. Each step of the discrete
        system is solved for its input, so this is exact.
        """
        result, crept = np.empty(len(target)), np.empty(len(target))
        state = _creeping(self._decay, state, target, gain, (result, crept))
        return state, result, crept


FilterState: TypeAlias = tuple[float, Array]
"""State of an axis' reference filter: of its creep and of its resonance."""


class ReferenceFilter:
    """Filter of one axis' reference by the inverse of its shift; the state is passed in."""

    def __init__(self, axis: AxisModel, sample_period: float) -> None:
        self._creep = SlowSection(axis, sample_period)
        self._resonance = ResonanceParts(axis, sample_period)

    def at_rest(self) -> FilterState:
        """State before a scan, which begins at zero."""
        return self._creep.at_rest(), self._resonance.at_rest()

    def apply(self, state: FilterState, block: Array, weights: Array) -> tuple[FilterState, Array]:
        """Adapted reference (n,), m, of a block (n,), m, by ``AxisShift.weights`` (4, n)."""
        creep, resonance = state
        resonance, parts = self._resonance.apply(resonance, block)
        adapted = weights[0] * block + weights[1] * parts[0] + weights[2] * parts[1]
        creep, adapted, _ = self._creep.without(creep, adapted, weights[3])
        return (creep, resonance), adapted


@compiled
def _parts(below: Array, above: Array, state: Array, block: Array, result: Array) -> None:
    for k in range(block.size):
        inner = block[k] - below[1] * state[0] - below[2] * state[1]
        for i in range(2):
            result[i, k] = above[i, 0] * inner + above[i, 1] * state[0] + above[i, 2] * state[1]
        state[1] = state[0]
        state[0] = inner


@compiled
def _creeping(
    decay: float, state: float, target: Array, gain: Array, results: tuple[Array, Array]
) -> float:
    for k in range(target.size):
        results[0][k] = target[k] - gain[k] * state
        results[1][k] = state
        state += decay * (state - results[0][k])
    return state
