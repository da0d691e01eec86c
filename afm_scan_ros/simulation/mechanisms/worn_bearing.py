"""A fan with a pit in the outer race of its bearing: balls that knock, on a shaft out of balance.

    z'' + 2 d w z' + w^2 z = w^2 amplitude cos(2 pi shaft t + phase)
                             + w amplitude (an impulse for each ball over the pit),    x_out = x + z

The balls roll round the inner race and drag their cage along at less than half the shaft's speed:
they pass a place of the outer race PASSES times a turn, which is no whole number. So there are two
sets of lines that share no fundamental. It has run for so long that only the forced motion is left,
in which each knock finds the rings of all before it.
Source: P. D. McFadden, J. D. Smith, J. Sound and Vibration 96 (1984) 69.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

BALLS, RATIO = 8, 0.27  # how many, and their diameter over that of the circle they run on
PASSES = 0.5 * BALLS * (1.0 - RATIO)
FRAME = (2.0 * np.pi * 130.0, 0.06)  # rad/s and damping ratio


@frozen(kw_only=True)
class WornBearing(Clocked):
    """``amplitude`` (m) of a knock without damping, and of the unbalance; ``shaft`` (Hz)."""

    KIND: ClassVar[str] = "worn_bearing"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)
    shaft: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> Array:
        """Share of the way between balls, and of a turn, gone by at first: it runs already."""
        return rng.uniform(size=2)

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) while the frame shakes."""
        natural, damping = FRAME
        passing, turn = PASSES * self.shaft, 2j * np.pi * self.shaft
        since = np.mod(drawn[0] + passing * time, 1.0) / passing
        s = natural * (1j * np.sqrt(1.0 - damping**2) - damping)
        rings = np.exp(s * since) / (1.0 - np.exp(s / passing))
        answer = natural**2 / (turn**2 + 2.0 * damping * natural * turn + natural**2)
        unbalance = answer * np.exp(turn * time + 2j * np.pi * drawn[1])
        shaken: Array = np.imag(rings) / np.sqrt(1.0 - damping**2) + np.real(unbalance)
        return own + self.amplitude * shaken
