"""Disturbances from outside."""

from typing import ClassVar

import numpy as np
from attrs import field, frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Clocked

ISOLATOR = (2.0 * np.pi * 25.0, 0.15)  # rad/s and damping ratio: rubber feet
LOOP = (2.0 * np.pi * 120.0, 0.02)


@frozen(kw_only=True)
class FloorVibration(Clocked):
    """A floor that shakes the microscope's table through its isolator, and the table the scanner.

        s'' = w_i^2 (floor - s) + 2 d_i w_i (floor' - s')    the table s on its isolator
        q'' + 2 d w q' + w^2 q = -s''                        the sample q, seen from the tip

    w and d belong to the mechanical loop from sample to tip, which is softer than the scanner
    alone. The floor moves as a sine of ``amplitude`` (m) at ``frequency`` (Hz) and its
    ``harmonics``: shares of the amplitude at 2, 3, ... times the frequency. Only the forced motion
    is computed. The phases are drawn anew for each scan.
    """

    KIND: ClassVar[str] = "floor_vibration"

    amplitude: float = quantity(suffix="_um", scale=1e-6)
    frequency: float = quantity(gt(0.0), suffix="_hz")
    harmonics: tuple[float, ...] = field()

    def drawn(self, rng: np.random.Generator) -> Array:
        """Phases (rad) of the floor's sines, which shakes already."""
        return rng.uniform(0.0, 2.0 * np.pi, 1 + len(self.harmonics))

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) while the table shakes."""
        shaken = own.copy()
        for i, share in enumerate((1.0, *self.harmonics)):
            s = 2j * np.pi * self.frequency * (i + 1)
            phasor = self.amplitude * share * _response(s) * np.exp(1j * drawn[i])
            shaken += np.imag(phasor * np.exp(s * time))
        return shaken


def _response(s: complex) -> complex:
    """Motion of the sample, seen from the tip, over that of the floor."""
    (isolator, loss), (loop, damping) = ISOLATOR, LOOP
    carried = 2.0 * loss * isolator * s + isolator**2
    table = carried / (s**2 + carried)
    return -(s**2) * table / (s**2 + 2.0 * damping * loop * s + loop**2)
