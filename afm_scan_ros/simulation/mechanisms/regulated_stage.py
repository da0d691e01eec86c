"""A stage whose temperature is regulated, and swings beyond where it was set before it settles.

    capacity T' = proportional (set - T) + integral (the sum of set - T over time)
    hence    T'' + 2 d w T' + w^2 T = 2 d w set' + w^2 set
    x_out = x + growth (T / set)

A cooler under a regulator that integrates, set to another temperature as the scan begins: what the
stage expands takes the sample along, ever faster at first, on beyond where it will be, and back.
Slow, and nothing that the drive does has a part in it: a drift, which turns round.
Source: K. J. Astrom, R. M. Murray, Feedback Systems, Princeton 2008, 10.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class RegulatedStage(Clocked):
    """``growth`` (m) in the end; ``period`` (s) and ``damping`` ratio of the regulator's swing."""

    KIND: ClassVar[str] = "regulated_stage"
    PLACE: ClassVar[Place] = "displacement"

    growth: float = quantity(suffix="_nm", scale=1e-9)
    period: float = quantity(gt(0.0), suffix="_s")
    damping: float = quantity(gt(0.0), lt(1.0))

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: it has just been set."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the stage."""
        natural, root = 2.0 * np.pi / self.period, np.sqrt(1.0 - self.damping**2)
        turned = natural * root * time
        swing = np.cos(turned) - self.damping / root * np.sin(turned)
        settled: Array = 1.0 - np.exp(-self.damping * natural * time) * swing
        return own + self.growth * settled
