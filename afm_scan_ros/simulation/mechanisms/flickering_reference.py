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
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

TONES = 60
LOWEST, HIGHEST = 0.5, 2000.0  # Hz


@frozen(kw_only=True)
class FlickeringReference(Insert):
    """``amplitude`` (1), rms.

    State: elapsed steps; the tones' frequencies (Hz) and phases (rad), shape (2, TONES).
    """

    KIND: ClassVar[str] = "flickering_reference"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity()

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, Array]:  # noqa: ARG002
        """Tones of which all is chance."""
        frequencies = LOWEST * (HIGHEST / LOWEST) ** rng.uniform(size=TONES)
        return 0, np.stack((frequencies, rng.uniform(0.0, 2.0 * np.pi, TONES)))

    def act(
        self,
        state: tuple[int, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, Array], Array]:
        """Displacement (m) by the reference of the moment."""
        elapsed, tones = state
        time = step * np.arange(elapsed, elapsed + own.size)
        noise = np.zeros(own.size)
        for frequency, phase in tones.T:
            noise += np.cos(2.0 * np.pi * frequency * time + phase)
        gain = 1.0 + self.amplitude * np.sqrt(2.0 / TONES) * noise
        return (elapsed + own.size, tones), own * gain
