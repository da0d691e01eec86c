"""The sensor's mirror, glued to the scanner by a soft glue that relaxes: a mass on Zener's solid.

    m q'' = -p,    p = k (q - x) + relaxing k h,    h' = q' - x' - h / settling

and the scanner feels p. Fast, the glue is stiffer by the share that relaxes slowly, and what its
dashpot takes damps the mirror: a further resonance of the structure, which pulls back at it. Exact
for a motion under the piezo that runs straight within a step; the equations are solved for
g = h - (q - x) in place of h, which x' does not enter.
Source: J. D. Ferry, Viscoelastic Properties of Polymers, 1980.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attached, Attachment, Stage
from afm_scan_ros.simulation.mechanisms.straight import Stepping
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class GluedMirror(Attachment):
    """``mass_ratio`` to the moving mass, ``frequency`` (Hz) of m on k.

    ``relaxing`` is the share of k that relaxes, after ``settling`` (s).
    """

    KIND: ClassVar[str] = "glued_mirror"

    mass_ratio: float = quantity(ge(0.0))
    frequency: float = quantity(gt(0.0), suffix="_hz")
    relaxing: float = quantity(gt(0.0))
    settling: float = quantity(gt(0.0), suffix="_ms", scale=1e-3)

    def attached(self, stage: Stage) -> "Glued":
        """Mirror on the axis."""
        natural = 2.0 * np.pi * self.frequency
        return Glued(self.row, stage, self.mass_ratio, natural, self.relaxing, self.settling)


@frozen(eq=False)
class Glued(Attached):
    """``mass`` over that of the axis, ``natural`` (rad/s), ``relaxing`` (1), ``settling`` (s).

    State of its own: q (m), q' (m/s), g (m).
    """

    mass: float
    natural: float
    relaxing: float
    settling: float

    def own_at_rest(self) -> Array:
        """The mirror where the scanner is, and nothing to relax."""
        return np.zeros(3)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while mirror and axis move."""
        states = Stepping.of(*self._equations(), step).run(state, path[0])
        state[:] = states[-1]
        return states[:, 0].copy()

    def _equations(self) -> tuple[Array, Array]:
        """A and b of the state u, u', q, q', g under x_d: p / k is a (q - u - x_d) + relaxing g."""
        fast, stage = 1.0 + self.relaxing, self.stage
        pull = self.mass * self.natural**2
        glue = np.array([-fast, 0.0, fast, 0.0, self.relaxing])
        flow = np.zeros((5, 5))
        flow[0, 1] = flow[2, 3] = 1.0
        flow[1] = pull * glue
        flow[1, :2] -= stage.natural**2, 2.0 * stage.damping * stage.natural
        flow[3] = -(self.natural**2) * glue
        flow[4] = np.array([1.0, 0.0, -1.0, 0.0, -1.0]) / self.settling
        entry = np.array([0.0, -pull * fast, 0.0, self.natural**2 * fast, 1.0 / self.settling])
        return flow, entry
