"""A cryostat whose nitrogen boils: bubbles that knock at the insert, when and how hard by chance.

    z'' + 2 d w z' + w^2 z = w amplitude (an impulse for each bubble),    x_out = x + z

Bubbles know nothing of each other: BUBBLES a second on the average, their sizes exponential with
mean ``amplitude``. It is a disturbance that nobody drives, in the band where the insert rings, and
that never repeats: no period, and no line that lasts longer than a ring does (shot noise).
Source: N. R. Campbell, Proc. Cambridge Phil. Soc. 15 (1909) 117.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.dynamics import ComplexArray
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

BUBBLES = 150.0  # 1/s
KNOCKS, BEFORE = 300_000, 1.0  # in all; s that it has boiled for when the scan begins
INSERT = (2.0 * np.pi * 120.0, 0.15)  # rad/s and damping ratio
ROOT = np.sqrt(1.0 - INSERT[1] ** 2)
POLE = INSERT[0] * (1j * ROOT - INSERT[1])


@frozen(kw_only=True)
class BoilingCryostat(Clocked):
    """``amplitude`` (m) that a bubble of the mean size would have without damping."""

    KIND: ClassVar[str] = "boiling_cryostat"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)

    def drawn(self, rng: np.random.Generator) -> tuple[Array, ComplexArray]:
        """When bubbles knock (s), and how the insert rings right after each, for a long while."""
        waits, sizes = rng.exponential(1.0 / BUBBLES, KNOCKS), rng.exponential(1.0, KNOCKS)
        return np.cumsum(waits) - BEFORE, _rings(np.exp(POLE * waits), sizes)

    def at(self, time: Array, own: Array, drawn: tuple[Array, ComplexArray]) -> Array:
        """Displacement (m) while the insert rings."""
        knocks, rings = drawn
        if time[-1] >= knocks[-1]:
            raise InputError(
                f"boiling_cryostat: the scan outlasts {KNOCKS} bubbles: it lasts"
                f" {knocks[-1]:.3g} s at most"
            )
        last = np.searchsorted(knocks, time, side="right") - 1
        ringing: Array = np.imag(rings[last] * np.exp(POLE * (time - knocks[last]))) / ROOT
        return own + self.amplitude * ringing


@compiled
def _rings(kept: ComplexArray, sizes: Array) -> ComplexArray:
    rings = np.empty_like(kept)
    ring = 0.0j
    for k in range(sizes.size):
        ring = ring * kept[k] + sizes[k]
        rings[k] = ring
    return rings
