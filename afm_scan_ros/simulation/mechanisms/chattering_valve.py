"""A relief valve in the cooling water that chatters: a relaxation oscillation of its own.

    z'' - STIFF (1 - z^2) z' + z = 0,    x_out = x + amplitude z

Barely open, the valve is pushed on by what flows; wide open, it is held back: between the two it
goes round on a cycle, resting at either side and turning over suddenly, with every odd multiple of
``frequency``. Neither drive nor scan has a part in it: a periodic disturbance. Time in the equation
is in units of the cycle's period over PERIOD. Runge-Kutta's fourth order.
Source: B. van der Pol, Philosophical Magazine 2 (1926) 978.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

STIFF, PERIOD = 3.0, 8.85909550  # of the equation, and of its cycle
ROUNDS, FINE = 6, 20_000  # cycles until it goes round, and steps for them


@frozen(kw_only=True)
class ChatteringValve(Insert):
    """``amplitude`` (m), half of what z reaches; ``frequency`` (Hz). State: z and z', (2,)."""

    KIND: ClassVar[str] = "chattering_valve"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)
    frequency: float = quantity(gt(0.0), suffix="_hz")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Somewhere on its cycle: it chatters already."""
        state = np.array([2.0, 0.0])
        _turn(state, np.empty(FINE), (ROUNDS + rng.uniform()) * PERIOD / FINE)
        return state

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what the valve shakes it by."""
        state, shaken = state.copy(), np.empty_like(own)
        _turn(state, shaken, step * self.frequency * PERIOD)
        return state, own + self.amplitude * shaken


@compiled
def _turn(state: Array, path: Array, ahead: float) -> None:
    """Z at the beginning of each step ``ahead``."""
    place, speed = state
    for k in range(path.size):
        path[k] = place
        moved = gained = z_slope = s_slope = 0.0
        for part, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            z, s = place + part * z_slope, speed + part * s_slope
            z_slope, s_slope = ahead * s, ahead * (STIFF * (1.0 - z * z) * s - z)
            moved += weight / 6.0 * z_slope
            gained += weight / 6.0 * s_slope
        place, speed = place + moved, speed + gained
    state[:] = place, speed
