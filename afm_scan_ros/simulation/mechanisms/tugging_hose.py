"""A rubber hose of the sample's cell that the other axis pulls at, and this one is pulled by.

    e = y + relaxing mean(h_i),    h_i' = y' - h_i / SETTLING_i,    x feels share e

Rubber pulls the harder the faster it is drawn, and relaxes through one decade after another
(Prony's series of Maxwell elements). The hose runs all but along y, so that only y draws it, and
its end is held by x askew: x moves where y alone has moved, a cross coupling, with a memory of
where y has been. Exact for a y that runs straight within a step; solved for g_i = h_i - y, which
y' does not enter. Source: R. M. Christensen, Theory of Viscoelasticity, Academic Press 1982, 1.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attached, Attachment, Stage
from afm_scan_ros.simulation.mechanisms.straight import Stepping
from afm_scan_ros.simulation.quantity import quantity

SETTLING = np.array([1e-3, 1e-2, 1e-1, 1.0])  # s


@frozen(kw_only=True)
class TuggingHose(Attachment):
    """``share`` of the other axis' displacement, slowly; ``relaxing``, that of the hose's pull."""

    KIND: ClassVar[str] = "tugging_hose"

    share: float = quantity()
    relaxing: float = quantity(ge(0.0))

    def attached(self, stage: Stage) -> "Hose":
        """Hose from the other axis to this one."""
        return Hose(self.row, stage, self.share, self.relaxing)


@frozen(eq=False)
class Hose(Attached):
    """A hose of ``share`` (1) that pulls by ``relaxing`` (1) more at once; its state: g (m)."""

    share: float
    relaxing: float

    def own_at_rest(self) -> Array:
        """Never drawn."""
        return np.zeros(SETTLING.size)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the other axis pulls."""
        states = Stepping.of(*self._equations(), step).run(state, path[1])
        state[:] = states[-1]
        return states[:, 0].copy()

    def _equations(self) -> tuple[Array, Array]:
        """A and b of the state u, u', g under y."""
        stage, count = self.stage, SETTLING.size
        pull = stage.natural**2 * self.share
        flow, entry = np.zeros((2 + count, 2 + count)), np.zeros(2 + count)
        flow[0, 1] = 1.0
        flow[1, :2] = -(stage.natural**2), -2.0 * stage.damping * stage.natural
        flow[1, 2:] = pull * self.relaxing / count
        flow[2:, 2:] = -np.diag(1.0 / SETTLING)
        entry[1] = pull * (1.0 + self.relaxing)
        entry[2:] = -1.0 / SETTLING
        return flow, entry
