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

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.charging import Charging

KNEE = 2.5  # V


@frozen(kw_only=True)
class CeramicFilter(Charging):
    """``capacitance`` is that at no voltage."""

    KIND: ClassVar[str] = "ceramic_filter"

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) of the capacitor in each step."""
        return _charge(state, own, step / self.constant, KNEE)


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
