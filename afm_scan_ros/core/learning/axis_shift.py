"""What has changed in an axis since its model was identified, and how a reference makes up for it.

The scanner's displacement is m times that of its model, with the gain's factor g and the first
resonance N(s) = s² + 2 ζ ω s + ω², whose frequency and damping have the factors f and d:

    m(s) = g f² N(s) / N'(s),    N'(s) = s² + 2 d ζ f ω s + f² ω²

Its inverse is affine in three coefficients of fixed filters, because N is the model's own:

    1/m = (1/g) (1 + a s²/N + b 2 ζ ω s/N),    a = 1/f² - 1,    b = d/f - 1

Slow creep adds c z behind the model's creep: z follows the displacement x0 (m) without it,
τ dz/dt + z = x0, with the slowest time constant τ of the model.
"""

from math import inf

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.parameter_shift import GAIN, RESONANCE
from afm_scan_ros.core.effects.slow_creep import GAIN as CREEP_GAIN
from afm_scan_ros.core.model import Added, AxisModel
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
        return found if found.within_bounds else None

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
    def within_bounds(self) -> bool:
        """Whether each value keeps to the bounds that the catalogue has for it."""
        values = self.gain, self.frequency, self.damping, self.creep
        factors = zip(BOUNDS, values, strict=True)
        return all(bound.lower < value < bound.upper for bound, value in factors)

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
