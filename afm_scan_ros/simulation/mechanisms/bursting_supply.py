"""A sensor whose excitation sags from one burst of its supply's converter to the next.

    x_read = x gain,    gain = e^(-sag s) over its mean,    s from 0 to 1 between two bursts

A switching converter under a light load skips its pulses: it charges its capacitor in a burst, and
the load discharges it until the next. A sensor that is not read in ratio to its excitation has a
gain that is a saw of this period, which has nothing to do with mains or scan. Nothing is seen at
zero, most at the ends of the range: a line in the gain, where the effects of the catalogue have
lines that are added.
Source: R. W. Erickson, D. Maksimovic, Fundamentals of Power Electronics, Springer 2020.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class BurstingSupply(Clocked):
    """``sag`` (1) of the excitation from burst to burst, ``bursts`` (Hz)."""

    KIND: ClassVar[str] = "bursting_supply"
    PLACE: ClassVar[Place] = "displacement"

    sag: float = quantity(gt(0.0))
    bursts: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Share of the way between two bursts that had gone by at first."""
        return float(rng.uniform())

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Displacement (m) as it is read."""
        since = np.mod(drawn + self.bursts * time, 1.0)
        gain: Array = np.exp(-self.sag * since) * self.sag / -np.expm1(-self.sag)
        return own * gain
