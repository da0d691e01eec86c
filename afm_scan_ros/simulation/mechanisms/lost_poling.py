"""A piezo that has lost some of its poling: less displacement for the same field.

d' = (1 - loss) d
"""

from typing import ClassVar

from attrs import evolve, frozen
from attrs.validators import lt

from afm_scan_ros.simulation.mechanisms.base import Alteration
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import AxisSpec, RationalSpec


@frozen(kw_only=True)
class LostPoling(Alteration):
    """``loss``: share of the displacement that is gone."""

    KIND: ClassVar[str] = "lost_poling"

    loss: float = quantity(lt(1.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move less; the further modes' peaks are shares of the first and fall with it."""
        whole = axis.vibration
        numerator = tuple((1.0 - self.loss) * each for each in whole.numerator)
        return evolve(axis, vibration=RationalSpec(numerator, whole.denominator))
