"""A sample holder on a spring: what carries the sample is not the stage.

    q'' + 2 d w (q' - x') + w^2 (q - x) = 0,    x_out = q

A light holder, which does not pull the stage back: a second resonance in series with the first.
Integrated by Runge-Kutta's fourth order, x running straight within a step.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class SprungHolder(Insert):
    """``frequency`` (Hz) and ``damping`` ratio; state: q (m), q' (m/s) and the last x (m)."""

    KIND: ClassVar[str] = "sprung_holder"
    PLACE: ClassVar[Place] = "displacement"

    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing moves."""
        return np.zeros(3)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the holder."""
        state = state.copy()
        return state, _swing(state, own, step, 2.0 * np.pi * self.frequency, self.damping)


@compiled
def _swing(state: Array, x: Array, step: float, natural: float, damping: float) -> Array:
    path = np.empty_like(x)
    for k in range(x.size):
        place, speed, last = state
        pace = (x[k] - last) / step
        total_place = total_speed = slope_place = slope_speed = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            q, v = place + ahead * step * slope_place, speed + ahead * step * slope_speed
            away = last + ahead * step * pace - q
            slope_place = v
            slope_speed = natural**2 * away + 2.0 * damping * natural * (pace - v)
            total_place += weight * slope_place
            total_speed += weight * slope_speed
        state[0] = place + step / 6.0 * total_place
        state[1] = speed + step / 6.0 * total_speed
        state[2] = x[k]
        path[k] = state[0]
    return path
