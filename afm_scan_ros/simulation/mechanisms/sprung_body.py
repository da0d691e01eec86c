"""A body on a lossy spring that the axes carry, and that pulls back at one of them.

    q'' + 2 d_b w_b (q' - carried') + w_b^2 (q - carried) = 0,    carried = a x + b y
    f = stiffness ((q - a x) + 2 d_b / w_b (q' - a x'))

x is the axis that feels the body, y the other one. See attachment.py for what f does.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attached


@frozen(eq=False)
class SprungBody(Attached):
    """``natural`` frequency (rad/s), ``damping`` ratio, shares ``a, b``, ``stiffness`` (1).

    ``stiffness`` is in units of the axis' own. State of its own: q (m) and q' (m/s).
    """

    natural: float
    damping: float
    shares: tuple[float, float]
    stiffness: float

    def own_at_rest(self) -> Array:
        """At rest where it is carried."""
        return np.zeros(2)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while body and axis move."""
        stage = (self.stage.natural, self.stage.damping)
        body = (self.natural, self.damping, *self.shares, self.stiffness)
        return _integrate(state, path, step, stage, body)


@compiled
def _integrate(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    body: tuple[float, float, float, float, float],
) -> Array:
    u = np.empty(path.shape[1] - 1)
    slope, trial, total = np.zeros(4), np.zeros(4), np.zeros(4)
    for k in range(u.size):
        slope[:] = 0.0
        total[:] = state
        x_speed = (path[0, k + 1] - path[0, k]) / step
        y_speed = (path[1, k + 1] - path[1, k]) / step
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            x = path[0, k] + ahead * (path[0, k + 1] - path[0, k])
            y = path[1, k] + ahead * (path[1, k + 1] - path[1, k])
            for i in range(4):
                trial[i] = state[i] + ahead * step * slope[i]
            _slopes(trial, (x, x_speed), (y, y_speed), stage, body, slope)
            for i in range(4):
                total[i] += step / 6.0 * weight * slope[i]
        state[:] = total
        u[k] = state[0]
    return u


@compiled
def _slopes(
    state: Array,
    x: tuple[float, float],
    y: tuple[float, float],
    stage: tuple[float, float],
    body: tuple[float, float, float, float, float],
    slope: Array,
) -> None:
    """Slopes of the state; ``x`` and ``y`` are path and speed under the piezo."""
    u, u_speed, q, q_speed = state
    natural, damping = stage
    own, loss, from_x, from_y, stiffness = body
    below, below_speed = from_x * (x[0] + u), from_x * (x[1] + u_speed)
    lag = 2.0 * loss / own
    force = stiffness * ((q - below) + lag * (q_speed - below_speed))
    slope[0] = u_speed
    slope[1] = natural**2 * (force - u) - 2.0 * damping * natural * u_speed
    slope[2] = q_speed
    carried = below + from_y * y[0]
    carried_speed = below_speed + from_y * y[1]
    slope[3] = own**2 * ((carried - q) + lag * (carried_speed - q_speed))
