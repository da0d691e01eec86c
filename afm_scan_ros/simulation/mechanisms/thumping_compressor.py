"""A compressor whose every stroke knocks at the frame, which rings down until the next.

    z'' + 2 d w z' + w^2 z = sum over the strokes of an impulse,    x_out = x + z

It has run for so long that each stroke finds the rings of all before it: a geometric series.
The lines are at the strokes' frequency and all its multiples, the highest near the frame's own.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Place
from afm_scan_ros.simulation.mechanisms.clocked import Clocked
from afm_scan_ros.simulation.quantity import quantity

FRAME = (2.0 * np.pi * 70.0, 0.08)  # rad/s and damping ratio


@frozen(kw_only=True)
class ThumpingCompressor(Clocked):
    """``amplitude`` (m) that a knock would have without damping, ``strokes`` (Hz)."""

    KIND: ClassVar[str] = "thumping_compressor"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)
    strokes: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Share of a stroke's period that had gone by at first: it runs already."""
        return float(rng.uniform())

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Displacement (m) while the frame rings."""
        since = np.mod(drawn + self.strokes * time, 1.0) / self.strokes
        (frame, damping), root = FRAME, np.sqrt(1.0 - FRAME[1] ** 2)
        s = frame * (1j * root - damping)
        ringing: Array = np.imag(np.exp(s * since) / (1.0 - np.exp(s / self.strokes)))
        return own + self.amplitude * ringing
