"""A pin of the scanner in a round hole of the sample's holder, wider than the pin: play in a plane.

    d = (x, y) - (x_out, y_out),    |d| <= gap,    and where |d| = gap the holder moves along d

The holder lies where friction holds it, until the pin touches the hole's wall and drags it,
straight away from where they touch. At each reversal the pin has to cross the hole, as much at any
speed: backlash, but along a chord, which depends on where the other axis' motion has left the hole.
The other axis is read at the pin. Exact for a pin that runs straight within a step: up to the wall,
and from there on the holder follows like a weight on a string (Leibniz' tractrix), tan of half its
angle to the pin's path falling by e each gap.
Source: J. J. Moreau, J. Differential Equations 26 (1977) 347 (what a moving set sweeps along).
"""

from math import hypot
from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class RoundHole(Insert):
    """``gap`` (m) by which the hole's radius exceeds the pin's.

    State: the holder along the axis and across, and the pin so, m, shape (4,).
    """

    KIND: ClassVar[str] = "round_hole"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(gt(0.0), suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """The pin in the middle of the hole."""
        return np.zeros(4)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the holder."""
        state = state.copy()
        return state, _drag(state, own, other, self.gap)


@compiled
def _drag(state: Array, x: Array, y: Array, gap: float) -> Array:
    path = np.empty_like(x)
    for k in range(x.size):
        way = hypot(x[k] - state[2], y[k] - state[3])
        if way > 0.0:
            ahead = (x[k] - state[2]) / way, (y[k] - state[3]) / way
            along = (state[2] - state[0]) * ahead[0] + (state[3] - state[1]) * ahead[1]
            aside = (state[3] - state[1]) * ahead[0] - (state[2] - state[0]) * ahead[1]
            wall = np.sqrt(max(gap**2 - aside**2, 0.0))
            dragged = way - (wall - along)
            if dragged > 0.0:
                half = aside / (gap + wall) * np.exp(-dragged / gap)
                along = gap * (1.0 - half**2) / (1.0 + half**2)
                aside = gap * 2.0 * half / (1.0 + half**2)
                state[0] = x[k] - along * ahead[0] + aside * ahead[1]
                state[1] = y[k] - along * ahead[1] - aside * ahead[0]
            state[2], state[3] = x[k], y[k]
        path[k] = state[0]
    return path
