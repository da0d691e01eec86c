"""An incremental encoder whose counter misses a mark now and then.

    x_read = x - mark (marks missed on the way up - marks missed on the way down)

Marks on the scale are counted as they pass; one is missed by chance, SPACING of travel after the
last one on the average, whichever way the scanner goes. What is lost once is not found again, until
one is missed on the way back: a step that comes suddenly and stays, now up, now down, never twice
the same. Nothing that moves the scanner has a part in it, and no effect of the catalogue jumps.
Source: D. R. Cox, Renewal Theory, Methuen 1962 (what has no memory waits exponentially).
"""

from typing import ClassVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

SPACING = 40e-6  # m
MISSES = 300_000


@frozen(kw_only=True)
class MiscountingEncoder(Insert):
    """``mark``: m from one to the next.

    State: m travelled, marks missed upwards less downwards, last x (m), m of travel at each miss.
    """

    KIND: ClassVar[str] = "miscounting_encoder"
    PLACE: ClassVar[Place] = "displacement"

    mark: float = quantity(suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[float, int, float, Array]:  # noqa: ARG002
        """It has just been set to zero; after what travel it will miss a mark is chance."""
        return 0.0, 0, 0.0, np.cumsum(rng.exponential(SPACING, MISSES))

    def act(
        self,
        state: tuple[float, int, float, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,  # noqa: ARG002
    ) -> tuple[tuple[float, int, float, Array], Array]:
        """Displacement (m) as it is counted."""
        before, missed, last, misses = state
        moved = np.diff(own, prepend=last)
        travelled = np.cumsum(np.concatenate(([before], np.abs(moved))))
        if travelled[-1] >= misses[-1]:
            raise InputError(
                f"miscounting_encoder: the scan outlasts {MISSES} missed marks: it travels"
                f" {misses[-1]:.3g} m at most"
            )
        lost = np.diff(np.searchsorted(misses, travelled)) * np.sign(moved).astype(int)
        total = missed + np.cumsum(lost)
        return (
            float(travelled[-1]),
            int(total[-1]),
            float(own[-1]),
            misses,
        ), own - self.mark * total
