"""A sensor whose reference flickers: its gain wanders by 1/f noise.

    x_read = x (1 + n),    n = amplitude sqrt(2 / TONES) sum cos(2 pi f_i t + phase_i)

Nothing is seen at zero, most at the ends of the range, and never twice the same: noise of the gain,
which no effect of the catalogue has. Tones of equal size whose frequencies are drawn evenly over
their logarithm have the spectrum 1/f, and many of them are noise (Rice).
Source: S. O. Rice, Bell System Technical Journal 23 (1944) 282.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

TONES = 60
LOWEST, HIGHEST = 0.5, 2000.0  # Hz


@frozen(kw_only=True)
class FlickeringReference(Clocked):
    """``amplitude`` (1), rms."""

    KIND: ClassVar[str] = "flickering_reference"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity()

    def drawn(self, rng: np.random.Generator) -> Array:
        """Tones' frequencies (Hz) and phases (rad), shape (2, TONES)."""
        frequencies = LOWEST * (HIGHEST / LOWEST) ** rng.uniform(size=TONES)
        return np.stack((frequencies, rng.uniform(0.0, 2.0 * np.pi, TONES)))

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) by the reference of the moment."""
        noise = np.zeros(own.size)
        for frequency, phase in drawn.T:
            noise += np.cos(2.0 * np.pi * frequency * time + phase)
        gain: Array = 1.0 + self.amplitude * np.sqrt(2.0 / TONES) * noise
        return own * gain
