"""Mechanisms of the displacement sensor."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, le, lt

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert


@frozen(kw_only=True)
class TiltedSensor(Insert):
    """A sensor whose axis is not parallel to the scanner's.

        x_read = x cos(angle) + y sin(angle)

    ``angle`` in rad, from the axis towards the other axis. There is no state.
    """

    KIND: ClassVar[str] = "tilted_sensor"

    angle: float = quantity(ge(-0.5), le(0.5), suffix="_mrad", scale=1e-3)

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) along the sensor's axis."""
        return None, np.cos(self.angle) * own + np.sin(self.angle) * other


@frozen(kw_only=True)
class TiltedPlate(Insert):
    """A capacitive sensor whose plates are not parallel.

        C = (eps A / 2 wedge) ln((gap - x + wedge) / (gap - x - wedge))

    The reading is the x at which parallel plates, ``gap`` apart at rest, have this capacitance.
    Offset and gain of the reading are adjusted at rest, so that the error grows with the square of
    the displacement. ``gap`` and ``wedge`` in m; each edge is ``wedge`` nearer or further than the
    middle. There is no state.

    Raises InputError where the plates touch at rest.
    """

    KIND: ClassVar[str] = "tilted_plate"

    gap: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    wedge: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def __attrs_post_init__(self) -> None:
        if self.wedge >= 0.9 * self.gap:
            raise InputError(
                f"wedge = {self.wedge:g} m all but closes the gap = {self.gap:g} m: lower it"
            )

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


@frozen(kw_only=True)
class CyclicEncoder(Insert):
    """An optical encoder whose two signals have unequal amplitudes: an error periodic in position.

        c = e^{i phi} + inequality e^{-i phi},   phi = 2 pi x / period
        reading: x where c = e^{i phi}

    The signals run on an ellipse instead of a circle, and the electronics take its angle. The error
    repeats twice a period. ``period`` in m, ``inequality`` (1). There is no state.
    """

    KIND: ClassVar[str] = "cyclic_encoder"

    period: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    inequality: float = quantity(ge(0.0), lt(1.0))

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Reading (m) for a displacement (m)."""
        turn = 2.0 * np.pi / self.period
        twice = 2.0 * turn * own
        ahead = np.arctan2(-self.inequality * np.sin(twice), 1.0 + self.inequality * np.cos(twice))
        return None, own + ahead / turn
