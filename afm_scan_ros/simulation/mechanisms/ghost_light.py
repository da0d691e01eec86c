"""A grating's sensor into which light from a shaking window falls: a fringe that never rests.

    c = e^{i phi} + ghost e^{i theta},    phi = 2 pi x / period,
    theta = SWING sin(2 pi f t + phase)
    reading: x where c = e^{i phi}

The ghost meets the light of the grating with a phase of its own, and the electronics take the angle
of both: an error that repeats with place, and shifts to and fro with time. A SWING at the first
zero of Bessel's J_0 leaves nothing of it that would stand still. It is no function of place, none
of time and no sum or product of two such: in no catalogue.
Source: C. Wu, R. D. Deslattes, Applied Optics 37 (1998) 6696 (periodic errors of interferometers).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, lt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

SWING = 2.404826  # rad


@frozen(kw_only=True)
class GhostLight(Clocked):
    """``period`` (m) of the grating, ``ghost`` (1) to its light; ``shaking`` (Hz) of the window."""

    KIND: ClassVar[str] = "ghost_light"
    PLACE: ClassVar[Place] = "displacement"

    period: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    ghost: float = quantity(ge(0.0), lt(1.0))
    shaking: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Phase (rad) of the window: it shakes already."""
        return float(rng.uniform(0.0, 2.0 * np.pi))

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Reading (m) for a displacement (m)."""
        turn = 2.0 * np.pi / self.period
        behind = SWING * np.sin(2.0 * np.pi * self.shaking * time + drawn) - turn * own
        ahead = np.arctan2(self.ghost * np.sin(behind), 1.0 + self.ghost * np.cos(behind))
        shown: Array = own + ahead / turn
        return shown
