"""A leaf of the flexures that has cracked: what the piezo pushes against is softer than it was.

    k' = (1 - loss) k:    d' = d / (1 - loss),    w' = w (1 - loss)^(1/2),    D' = D w / w'

The same force of the piezo moves a softer structure further, and the same mass and dashpot on it
swing more slowly: gain, resonance and damping ratio shift at once, tied to each other. What the
scanner is made of is the same with other values: a shift of parameters. The further modes, which
have leaves of their own, stay what they were.
"""

from typing import ClassVar

from attrs import evolve, frozen
from attrs.validators import ge, lt

from afm_scan_ros.simulation.detune import detuned_axis
from afm_scan_ros.simulation.mechanisms.base import Alteration
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import AxisSpec, RationalSpec


@frozen(kw_only=True)
class CrackedLeaf(Alteration):
    """``loss``: share of the axis' stiffness that is gone."""

    KIND: ClassVar[str] = "cracked_leaf"

    loss: float = quantity(ge(0.0), lt(1.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move further, and swing more slowly.

        A further mode's peak is a share of the first, which has grown.
        """
        left = 1.0 - self.loss
        softer = detuned_axis(axis, left**0.5, left**-0.5)
        numerator = tuple(each / left for each in softer.vibration.numerator)
        modes = tuple(evolve(m, relative_peak=left * m.relative_peak) for m in softer.modes)
        vibration = RationalSpec(numerator, softer.vibration.denominator)
        return evolve(softer, vibration=vibration, modes=modes)
