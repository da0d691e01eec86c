"""Domains that are pinned more, or less, than they were: the loop is wider or narrower.

density' = factor density
"""

from typing import ClassVar

from attrs import evolve, frozen
from attrs.validators import ge

from afm_scan_ros.simulation.mechanisms.base import Alteration
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import AxisSpec


@frozen(kw_only=True)
class HardenedDomains(Alteration):
    """``factor`` of the density of plays at every threshold."""

    KIND: ClassVar[str] = "hardened_domains"

    factor: float = quantity(ge(0.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """More, or fewer, domains that lag behind the field."""
        density = self.factor * axis.hysteresis.density
        return evolve(axis, hysteresis=evolve(axis.hysteresis, density=density))
