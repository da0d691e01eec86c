"""An amplifier that charges the piezo through a resistance.

    R C dv/dt = u - v

The piezo's capacitance takes its time; the exponential is exact while the converter holds u.
"""

from typing import ClassVar

from attrs import frozen

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.charging import Charging
from afm_scan_ros.simulation.mechanisms.first_order import follow


@frozen(kw_only=True)
class LaggingAmplifier(Charging):
    """The capacitance is the piezo's."""

    KIND: ClassVar[str] = "lagging_amplifier"

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return follow(state, own, step / self.constant)
