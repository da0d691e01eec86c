"""A taut cable from the sample to the frame, which the stage plucks at one end: a row of modes.

    mass w_tt + loss w_t = tension w_ss,    w(0) = x,    w(length) = 0
    x feels tension (w_s(0) + x / length)

The cable swings at ``frequency`` and its multiples, where the stage drives it, and pulls back at
the stage: extra resonances, of one origin. With s in lengths and r_n the integral of
2 w sin(n pi s),

    r_n'' + 2 d w_1 r_n' + w_n^2 (r_n - 2 x / (n pi)) = 0,    w_n = n w_1
    x feels share sum (n pi r_n - 2 x)

of which the first ``TERMS`` are kept. Its steady pull is in the axis' stiffness, as stated.
Source: P. M. Morse, Vibration and Sound, McGraw-Hill 1948, 9 and 13.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attached, Attachment, Stage
from afm_scan_ros.simulation.mechanisms.straight import Stepping
from afm_scan_ros.simulation.quantity import quantity

TERMS = 5
ORDERS = np.arange(1, TERMS + 1, dtype=np.float64)


@frozen(kw_only=True)
class TautCable(Attachment):
    """``share``: tension over length, in units of the axis' stiffness.

    ``frequency`` (Hz) of the cable's first mode, and ``damping`` ratio d there.
    """

    KIND: ClassVar[str] = "taut_cable"

    share: float = quantity(ge(0.0))
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def attached(self, stage: Stage) -> "Cable":
        """Cable at the axis."""
        natural = 2.0 * np.pi * self.frequency
        return Cable(self.row, stage, self.share, natural, self.damping)


@frozen(eq=False)
class Cable(Attached):
    """``share`` (1), ``natural`` (rad/s) and ``damping`` ratio of the first mode.

    State of its own: r (m) and r' (m/s).
    """

    share: float
    natural: float
    damping: float

    def own_at_rest(self) -> Array:
        """Straight."""
        return np.zeros(2 * TERMS)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while cable and axis swing."""
        states = Stepping.of(*self._equations(), step).run(state, path[0])
        state[:] = states[-1]
        return states[:, 0].copy()

    def _equations(self) -> tuple[Array, Array]:
        """A and b of the state u, u', r, r' under x_d."""
        stage, swings = self.stage, (self.natural * ORDERS) ** 2
        flow, entry = np.zeros((2 + 2 * TERMS, 2 + 2 * TERMS)), np.zeros(2 + 2 * TERMS)
        bends, speeds = slice(2, 2 + TERMS), slice(2 + TERMS, None)
        flow[0, 1] = 1.0
        flow[1, bends] = stage.natural**2 * self.share * np.pi * ORDERS
        flow[bends, speeds] = np.eye(TERMS)
        flow[speeds, bends] = -np.diag(swings)
        flow[speeds, speeds] = -2.0 * self.damping * self.natural * np.eye(TERMS)
        entry[1] = -2.0 * TERMS * stage.natural**2 * self.share
        entry[speeds] = swings * 2.0 / (np.pi * ORDERS)
        flow[:, 0] += entry  # u moves the cable's end as x_d does
        flow[1, :2] -= stage.natural**2, 2.0 * stage.damping * stage.natural
        return flow, entry
