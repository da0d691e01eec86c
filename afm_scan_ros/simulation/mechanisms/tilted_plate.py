"""A capacitive sensor whose plates are not parallel.

    C = (eps A / 2 wedge) ln((gap - x + wedge) / (gap - x - wedge))
    reading: the x at which parallel plates, ``gap`` apart at rest, have this capacitance

``wedge`` is by how much either edge is nearer or further than the middle. The electronics know
parallel plates; their zero and gain are adjusted at rest, so what is left grows with the square
of the displacement.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity


@frozen(kw_only=True)
class TiltedPlate(Insert):
    """``gap`` and ``wedge`` in m; there is no state.

    Raises InputError where the plates touch.
    """

    KIND: ClassVar[str] = "tilted_plate"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    wedge: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def __attrs_post_init__(self) -> None:
        if self.wedge >= 0.9 * self.gap:
            raise InputError(
                f"wedge = {self.wedge:g} m all but closes the gap = {self.gap:g} m: lower it"
            )

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Reading (m) for a displacement (m); raises ScanError where the plates touch."""
        if np.max(own) >= self.gap - self.wedge:
            raise ScanError(
                f"axis {self.axis}: displacement = {np.max(own):.6g} m makes the sensor's plates"
                f" touch, {self.gap:g} m apart: scan a smaller range"
            )
        rest, slope = self._parallel(self.gap)
        gap, _ = self._parallel(self.gap - own)
        return None, (rest - gap) / slope

    def _parallel(self, gap: Array | float) -> tuple[Array, Array]:
        """Gap (m) of parallel plates of the same capacitance, and its slope over the true gap."""
        half = 0.5 * np.log((gap + self.wedge) / (gap - self.wedge))
        alike = self.wedge / half
        return alike, alike**2 / (gap**2 - self.wedge**2)
