"""An amplifier that rings with the piezo as its load: a loop with little phase margin.

    v'' + 2 d w v' + w^2 v = w^2 u

The piezo's capacitance behind the amplifier's output resistance turns the phase of its feedback,
and what is left is a resonance of the drive, before the hysteresis. Exact while the converter
holds u, by its conjugate pair of sections z' = p (z - u).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class RingingAmplifier(Insert):
    """``frequency`` (Hz) and ``damping`` ratio; state: the section z, V."""

    KIND: ClassVar[str] = "ringing_amplifier"
    PLACE: ClassVar[Place] = "drive"

    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> complex:  # noqa: ARG002
        """Discharged."""
        return 0j

    def act(self, state: complex, own: Array, other: Array, step: float) -> tuple[complex, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        root = np.sqrt(1.0 - self.damping**2)
        pole = 2.0 * np.pi * self.frequency * complex(-self.damping, root)
        gain = complex(1.0, -self.damping / root)
        return _ring(state, own, pole * step, gain)


@compiled
def _ring(section: complex, drive: Array, turn: complex, gain: complex) -> tuple[complex, Array]:
    kept = np.exp(turn)
    mean, lasting = np.empty_like(drive), (kept - 1.0) / turn
    for k in range(drive.size):
        behind = section - drive[k]
        mean[k] = (gain * (drive[k] + lasting * behind)).real
        section = drive[k] + kept * behind
    return section, mean
