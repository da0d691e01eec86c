"""An effect to test against."""

from collections.abc import Callable

from attrs import frozen

from afm_scan_ros.simulation.mechanisms.base import Mechanism

CAPACITANCE = 100e-9  # F, of the piezo


@frozen
class Effect:
    """A mechanism of an axis and a size, and the name of the effect that explains it.

    ``name`` is None where no declared effect does.
    """

    name: str | None
    mechanism: Callable[[str, float], Mechanism]
    sizes: tuple[float, float, float]
