"""A filter before the amplifier whose ceramic capacitor loses capacitance under voltage.

    resistance C(v) v' = u - v,    C(v) = capacitance / (1 + (v / KNEE)^2)^(1/3)

Barium titanate is the harder to polarise the further it is polarised (the law is Landau's, to its
fourth power): a capacitor of class two has less of its capacitance at 5 V than at none. Late by
resistance * C, most about zero, and it damps what is faster: an input lag. The piezo sees v. While
the converter holds u, C is what it is in the middle of a step.
Source: K. M. Johnson, J. Applied Physics 33 (1962) 2826.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

KNEE = 2.5  # V


@frozen(kw_only=True)
class CeramicFilter(Insert):
    """``resistance`` in Ohm, ``capacitance`` at no voltage in F; state: the capacitor's, V."""

    KIND: ClassVar[str] = "ceramic_filter"
    PLACE: ClassVar[Place] = "drive"

    resistance: float = quantity(gt(0.0), suffix="_ohm")
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) of the capacitor in each step."""
        return _charge(state, own, step / (self.resistance * self.capacitance), KNEE)


@compiled
def _charge(voltage: float, drive: Array, steps: float, knee: float) -> tuple[float, Array]:
    """``steps``: a step in time constants at no voltage."""
    mean = np.empty_like(drive)
    for k in range(drive.size):
        behind = voltage - drive[k]
        middle = drive[k] + behind * np.exp(-0.5 * steps * _sooner(voltage, knee))
        gone = steps * _sooner(middle, knee)
        mean[k] = drive[k] - behind * np.expm1(-gone) / gone
        voltage = drive[k] + behind * np.exp(-gone)
    return voltage, mean


@inlined
def _sooner(voltage: float, knee: float) -> float:
    """Capacitance at no voltage over that at ``voltage``."""
    return float((1.0 + (voltage / knee) ** 2) ** (1.0 / 3.0))
