"""Resonances as polynomials in descending powers of s: a model's first one, and further ones."""

from collections.abc import Iterable

import numpy as np
from attrs import evolve, field, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, floats


def resonant(omega: float, damping: float) -> Array:
    """Return s² + 2 damping omega s + omega², omega in rad/s."""
    return np.array([1.0, 2.0 * damping * omega, omega**2])


def with_vibration(chain: Chain, numerator: Iterable[float], denominator: Iterable[float]) -> Chain:
    """Chain of which the vibration has other polynomials."""
    vibration = evolve(chain.model.vibration, numerator=numerator, denominator=denominator)
    return evolve(chain, model=evolve(chain.model, vibration=vibration))


def multiplied(chain: Chain, numerator: Iterable[float], denominator: Iterable[float]) -> Chain:
    """Chain of which the vibration has other polynomials, by an effect that multiplies it.

    It multiplies what the model lacks too, so the inverse keeps to the motion that its weight was
    chosen for: a mode beyond the model would ring the more, the more the inverse passed there.
    """
    before = chain.before or chain.model.vibration
    return evolve(with_vibration(chain, numerator, denominator), before=before)


@frozen
class Resonance:
    """G's denominator is ``rest`` times s² + 2 ``damping`` ``omega`` s + ``omega``² (rad/s)."""

    omega: float
    damping: float
    rest: tuple[float, ...] = field(converter=floats)

    @property
    def frequency(self) -> float:
        """Frequency without damping, Hz."""
        return self.omega / (2.0 * np.pi)

    @property
    def factor(self) -> Array:
        """Its polynomial in descending powers of s, shape (3,)."""
        return resonant(self.omega, self.damping)


def first_resonance(vibration: VibrationModel) -> Resonance:
    """Return the resonance that rises highest; raises InputError where there is none."""
    if (pole := vibration.resonant_pole) is None:
        raise InputError("the vibration model has no resonance: leave out effects that act on one")
    omega, damping = abs(pole), -pole.real / abs(pole)
    rest = np.polydiv(vibration.denominator, resonant(omega, damping))[0]
    return Resonance(omega, damping, rest)
