"""A lead to the piezo that lets go now and then: a piezo without a lead keeps its charge.

    v = u            while it touches, on the average for CLOSED s
        held         while it does not, on the average for ``opened`` s

and jumps to u when it touches again. Nothing says when: no effect of the catalogue comes and goes.
Both durations are exponential, as of what has no memory.
Source: R. Holm, Electric Contacts, Springer 1967.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity

CLOSED = 1e-3  # s
OPENINGS = 1_000_000


@frozen(kw_only=True)
class LooseContact(Insert):
    """``opened`` in s. State: elapsed steps, held voltage (V); when it opens and closes, s."""

    KIND: ClassVar[str] = "loose_contact"
    PLACE: ClassVar[Place] = "drive"

    opened: float = quantity(ge(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, float, Array]:  # noqa: ARG002
        """It touches; when it does not is chance, drawn once for a long while."""
        lasting = rng.exponential(1.0, (OPENINGS, 2)) * (CLOSED, self.opened)
        return 0, 0.0, np.cumsum(lasting.ravel())

    def act(
        self,
        state: tuple[int, float, Array],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, float, Array], Array]:
        """Mean voltage (V) across the piezo in each step."""
        elapsed, held, changes = state
        edges = step * np.arange(elapsed, elapsed + own.size + 1, dtype=np.float64)
        if edges[-1] >= changes[-1]:
            raise InputError(
                f"loose_contact: the scan outlasts {OPENINGS} openings: it lasts"
                f" {changes[-1]:.3g} s at most"
            )
        held, mean = _held(held, own, edges, changes)
        return (elapsed + own.size, held, changes), mean


@compiled
def _held(held: float, drive: Array, edges: Array, changes: Array) -> tuple[float, Array]:
    """Mean in each step; an even count of changes so far is a contact that touches."""
    mean, after = np.empty_like(drive), np.searchsorted(changes, edges[0], side="right")
    for k in range(drive.size):
        start, total = edges[k], 0.0
        while start < edges[k + 1]:
            if after % 2 == 0:
                held = drive[k]
            end = min(changes[after], edges[k + 1])
            total += (end - start) * held
            after += changes[after] <= edges[k + 1]
            start = end
        mean[k] = total / (edges[k + 1] - edges[k])
    return held, mean
