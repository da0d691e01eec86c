"""How long each side of the link waits for the driver."""

from attrs import frozen

from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.settings import ScannerSettings

ENDING = 3.0
"""Longest time (s), beside the ramp itself, for the outputs to be at rest."""


@frozen
class Waits:
    """Longest waits (s).

    After ``silence`` of the ROS side the outputs ramp down. ``opening`` bounds the driver's
    constructor, and its ``start``. An answer to a block may come ``answer`` after the block and its
    readings are due. A driver that takes longer hangs, and its process ends.
    """

    silence: float
    opening: float
    answer: float

    def for_answer(self, block: Trace, latency_samples: int) -> float:
        """Longest time (s) that the driver may take for a block, with its late readings."""
        return (block.x.size + latency_samples) * block.sample_period + self.answer


def ramp_bound(settings: ScannerSettings, late: float) -> float:
    """Longest time (s) that a ramp to rest may take, from any drive within the limits.

    Before it the driver outputs what is in its buffer, whose readings come ``late`` (s): twice
    that at most.
    """
    return settings.amplifier.longest_ramp + 2.0 * late + ENDING


def late(seconds: float) -> str:
    """Say that the driver has taken longer than it may (s)."""
    return f"the driver has not answered for {seconds:.3g} s"
