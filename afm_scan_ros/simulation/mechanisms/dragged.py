"""Blocks of a hysteresis that come late; driven slowly they are the healthy scanner's plays."""

from abc import ABC, abstractmethod

from attrs import frozen

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.play import PlayBank


@frozen(eq=False)
class DraggedBank(ABC):
    """The ``plays`` of a hysteresis, dragged; state: the blocks' positions, V, (elements,)."""

    plays: PlayBank

    @abstractmethod
    def dragged(self, field: Array, positions: Array) -> Array:
        """Mean of field and all blocks, V, in each step of a field (n,); moves ``positions``."""

    def relaxed(self) -> Array:
        """State of a virgin scanner."""
        return self.plays.relaxed()

    def apply(self, positions: Array, drive: Array) -> tuple[Array, Array]:
        """Mean effective input F (V) in each step of drive (V), both of shape (n,)."""
        positions = positions.copy()
        total = self.dragged(self.plays.field(drive), positions)
        return positions, self.plays.effective(total)
