"""A rod between scanner and tip, heated at one end: heat diffuses through it.

    dT/dt = D d2T/dz2,    T(0) = heating, no heat flows at z = length
    x_out = x + expansion length mean(T)

Its length grows with the square root of time at first and settles as an exponential. Diffusion is
solved by its first eigenfunctions, cos((n + 1/2) pi (1 - z / length)): those left out are 0.3 % of
the growth at t = 0, and gone after 1e-4 of the diffusion time.
Source: H. S. Carslaw and J. C. Jaeger, Conduction of Heat in Solids, Oxford 1959, 3.4.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

TERMS = 60


@frozen(kw_only=True)
class HeatedRod(Clocked):
    """``growth`` (m) in the end, ``diffusion_time`` length^2 / D (s)."""

    KIND: ClassVar[str] = "heated_rod"
    PLACE: ClassVar[Place] = "displacement"

    growth: float = quantity(suffix="_um", scale=1e-6)
    diffusion_time: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: the heater has just been turned on."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the rod."""
        warm = np.ones(own.size)
        for n in range(TERMS):
            root = (n + 0.5) * np.pi
            warm -= 2.0 / root**2 * np.exp(-(root**2) * time / self.diffusion_time)
        return own + self.growth * warm
