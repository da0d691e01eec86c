"""The first resonance of a vibration model, as a factor of its denominator."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

DAMPED = 0.5
"""Damping from which on a pair of poles is no resonance."""


@frozen(eq=False)
class Resonance:
    """G's denominator is ``rest`` times s² + 2 ``damping`` ``omega`` s + ``omega``² (rad/s)."""

    omega: float
    damping: float
    rest: Array

    @property
    def factor(self) -> Array:
        """Its polynomial in descending powers of s, shape (3,)."""
        return np.array([1.0, 2.0 * self.damping * self.omega, self.omega**2])


def first_resonance(vibration: VibrationModel) -> Resonance:
    """Return the resonance of lowest frequency; raises InputError where there is none."""
    poles = np.roots(vibration.denominator)
    poles = poles[(poles.imag > 0.0) & (-poles.real < DAMPED * np.abs(poles))]
    if not poles.size:
        raise InputError("the vibration model has no resonance: leave out effects that act on one")
    pole = poles[np.abs(poles).argmin()]
    omega, damping = float(np.abs(pole)), float(-pole.real / np.abs(pole))
    rest = np.polydiv(vibration.denominator, [1.0, 2.0 * damping * omega, omega**2])[0]
    return Resonance(omega, damping, np.asarray(rest, dtype=np.float64))
