"""Hysteresis by the paper's own inverse: a Preisach model identified from output to input.

Equation: Croft, Shed and Devasia (2001), Eqs. 11 to 17, with the surface U(alpha, beta) over the
effective input F. It is the same operator as the forward model's with the two sides exchanged,
so what applies one inverts the other.
"""

from afm_scan_ros.core.effects.base import CausalInverse
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Memory, Preisach, depolarising
from afm_scan_ros.core.types import Array


class DirectInverse(CausalInverse):
    """Hysteresis of one axis whose inverse is a Preisach model; the state is that one's Memory.

    ``surface`` is over F (V), its output u (V). Samples beyond it raise BeyondRangeError.
    """

    def __init__(self, surface: EverettSurface) -> None:
        self._preisach = Preisach(surface)

    def at_rest(self) -> Memory:
        """Memory after a drive u that decayed from both of its limits to zero."""
        surface = self._preisach.surface
        oscillation = depolarising(surface.output_lower, surface.output_upper)
        return self._preisach.invert(self._preisach.saturated(), oscillation)[0]

    def apply(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        return self._preisach.invert(state, block)

    def inverse_at_rest(self) -> Memory:
        """Memory of the inverse: the same material, depolarised."""
        return self.at_rest()

    def invert(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Inputs u (V) for a block of effective inputs F (V), both (n,)."""
        return self._preisach.apply(state, block)
