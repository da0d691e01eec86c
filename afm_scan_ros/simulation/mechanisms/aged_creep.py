"""A piezo that has aged: its domains give way more easily or less, and it creeps otherwise.

g' = factor g
"""

from typing import ClassVar

from attrs import evolve, frozen
from attrs.validators import ge

from afm_scan_ros.simulation.creep import series, with_series
from afm_scan_ros.simulation.mechanisms.base import Alteration
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import AxisSpec


@frozen(kw_only=True)
class AgedCreep(Alteration):
    """``factor`` of how far every element creeps."""

    KIND: ClassVar[str] = "aged_creep"

    factor: float = quantity(ge(0.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Creep further by the factor, as fast."""
        gains, taus = series(axis.creep)
        return evolve(axis, creep=with_series(axis.creep, self.factor * gains, taus))
