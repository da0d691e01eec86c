"""What several parts that give way in turn have in common, attached to a stage.

Each is a spring up to its reach, all equally stiff; how it gives way is said by each file.
"""

from typing import ClassVar

import numpy as np
from attrs import field, frozen
from attrs.validators import deep_iterable, ge, gt, min_len

from afm_scan_ros.core.compiled import inlined
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.attachment import Attached, Attachment, Stage
from afm_scan_ros.simulation.quantity import quantity


@frozen(eq=False)
class Parts(Attached):
    """Parts of ``share`` (1) altogether, with ``reaches`` (m).

    State of their own: how far each is bent, m, shape (parts,).
    """

    share: float
    reaches: Array

    def own_at_rest(self) -> Array:
        """None is bent."""
        return np.zeros(self.reaches.size)


@frozen(kw_only=True)
class GivingWay(Attachment):
    """``share`` of the axis' stiffness that the parts add, and how far each reaches, m.

    ``PARTS`` are those of the kind.
    """

    PARTS: ClassVar[type[Parts]]

    share: float = quantity(ge(0.0))
    reaches: tuple[float, ...] = field(
        validator=[min_len(1), deep_iterable(gt(0.0))], metadata={"suffix": "_um", "scale": 1e-6}
    )

    def attached(self, stage: Stage) -> Parts:
        """Parts that are all equally stiff."""
        return self.PARTS(self.row, stage, self.share, np.array(self.reaches))


@inlined
def swing(state: Array, step: float, stage: tuple[float, float], share: float) -> None:
    """Move u and u' on by a step under the pull of all parts: leapfrog."""
    natural, damping = stage
    loss = damping * natural * step
    pull = -share * state[2:].mean() - state[0]
    state[1] = ((1.0 - loss) * state[1] + step * natural**2 * pull) / (1.0 + loss)
    state[0] += step * state[1]
