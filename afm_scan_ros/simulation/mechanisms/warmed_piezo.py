"""A piezo that is warmer than it was when its model was made: it moves further, and creeps faster.

    d' = (1 + SOFTENING kelvin) d,    1 / tau' = e^(ACTIVATION / k (1 / ROOM - 1 / T)) / tau

Domains turn more easily, and those that creep wait for heat to help them over (Arrhenius). The
warmth stays as it is during a scan, so that what the scanner is made of is the same, with other
values: a shift of parameters. ACTIVATION is that of walls that creep in a soft ceramic, SOFTENING
what makers state for one; both are rounded.
"""

from typing import ClassVar

import numpy as np
from attrs import evolve, frozen
from attrs.validators import gt

from afm_scan_ros.simulation.creep import series, with_series
from afm_scan_ros.simulation.mechanisms.base import Alteration
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import AxisSpec, RationalSpec

ROOM = 295.0  # K
ACTIVATION = 0.6 / 8.617e-5  # K: 0.6 eV over Boltzmann's constant
SOFTENING = 1.5e-3  # 1/K


@frozen(kw_only=True)
class WarmedPiezo(Alteration):
    """``kelvin`` above the room in which the scanner was identified."""

    KIND: ClassVar[str] = "warmed_piezo"

    kelvin: float = quantity(gt(-ROOM), suffix="_k")

    @property
    def further(self) -> float:
        """Factor of all displacement."""
        return 1.0 + SOFTENING * self.kelvin

    @property
    def sooner(self) -> float:
        """Factor of all rates of creep."""
        return float(np.exp(ACTIVATION * (1.0 / ROOM - 1.0 / (ROOM + self.kelvin))))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move further by the softer domains, creep sooner by the warmer ones."""
        whole, (gains, taus) = axis.vibration, series(axis.creep)
        numerator = tuple(self.further * each for each in whole.numerator)
        creep = with_series(axis.creep, gains, taus / self.sooner)
        return evolve(axis, vibration=RationalSpec(numerator, whole.denominator), creep=creep)
