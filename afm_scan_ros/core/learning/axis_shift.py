"""What has changed in an axis since its model was identified, and how a reference makes up for it.

The scanner's displacement is m times that of its model, with the gain's factor g and the first
resonance N(s) = s² + 2 ζ ω s + ω², whose frequency and damping have the factors f and d:

    m(s) = g f² N(s) / N'(s),    N'(s) = s² + 2 d ζ f ω s + f² ω²

Its inverse is affine in three coefficients of fixed filters, because N is the model's own:

    1/m = (1/g) (1 + a s²/N + b 2 ζ ω s/N),    a = 1/f² - 1,    b = d/f - 1

The slowest section of creep gives κ z more than that of the model, where z is its output (m).
"""

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.parameter_shift import GAIN, RESONANCE
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.model import Added, AxisModel
from afm_scan_ros.core.types import Array

LARGEST_CREEP = 1.0
"""Of κ: the section is doubled, or gone."""


@frozen
class AxisShift:
    """Factors on an axis' gain and on its first resonance's frequency and damping, and κ."""

    gain: float = 1.0
    frequency: float = 1.0
    damping: float = 1.0
    creep: float = 0.0

    @classmethod
    def of(cls, unknowns: Array) -> "AxisShift | None":
        """Return the shift of (g - 1, a, b, κ); None outside the catalogue's bounds."""
        change, alpha, beta, creep = (float(each) for each in unknowns)
        if alpha <= -1.0:
            return None
        frequency = (1.0 + alpha) ** -0.5
        found = cls(1.0 + change, frequency, frequency * (1.0 + beta), creep)
        return found if found.within_bounds else None

    @property
    def unknowns(self) -> Array:
        """Return (g - 1, a, b, κ)."""
        alpha, beta = self.frequency**-2 - 1.0, self.damping / self.frequency - 1.0
        return np.array([self.gain - 1.0, alpha, beta, self.creep])

    @property
    def within_bounds(self) -> bool:
        """Whether each factor keeps to the bounds of the catalogue's ``parameter_shift``."""
        factors = zip((*GAIN, *RESONANCE), (self.gain, self.frequency, self.damping), strict=True)
        kept = all(bound.lower < value < bound.upper for bound, value in factors)
        return kept and abs(self.creep) < LARGEST_CREEP

    @property
    def weights(self) -> Array:
        """Weights (4,) of the reference, of its two filtered parts, and of creep's section."""
        _, alpha, beta, creep = self.unknowns
        return np.array([1.0 / self.gain, alpha / self.gain, beta / self.gain, creep])


def room() -> Array:
    """Distance of (g - 1, a, b, κ) from 0 to the nearest bound, shape (4,)."""
    gain, frequency, damping = (*GAIN, *RESONANCE)
    alpha = min(1.0 - frequency.upper**-2, frequency.lower**-2 - 1.0)
    return np.array([1.0 - gain.lower, alpha, 1.0 - damping.lower, LARGEST_CREEP])


def with_shift(axis: AxisModel, shift: AxisShift) -> AxisModel:
    """Return the model of an axis with a shift added, each part of it as the catalogue's effect.

    Raises InputError where the model has no resonance, or no creep, that has changed.
    """
    added = []
    if shift.gain != 1.0:
        added.append(Added("parameter_shift", "gain", (shift.gain,)))
    if (shift.frequency, shift.damping) != (1.0, 1.0):
        added.append(Added("parameter_shift", "resonance", (shift.frequency, shift.damping)))
    if shift.creep != 0.0:
        gain, constant = slowest_section(axis)
        kind = effect_type("slow_creep").forms[0].kind
        added.append(Added("slow_creep", kind, (shift.creep * gain, constant)))
    return evolve(axis, added=(*axis.added, *added))


def slowest_section(axis: AxisModel) -> tuple[float, float]:
    """Gain and time constant (s) of the slowest section of creep; 0 and 1 s without creep."""
    sections = zip(axis.creep.gains, axis.creep.time_constants, strict=True)
    return max(sections, key=lambda section: section[1], default=(0.0, 1.0))
