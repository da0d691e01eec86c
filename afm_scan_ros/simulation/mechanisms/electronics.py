"""Mechanisms of the electronics: converter, amplifier and displacement sensor.

The piezo is a capacitance. Solutions of the drive are exact while the converter holds its output.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, le, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert, Place


@compiled
def follow(state: float, wanted: Array, steps: float) -> tuple[float, Array]:
    """Follow a held input through one time constant: the state at the end, and the means (n,)."""
    done = -np.expm1(-steps)
    mean = np.empty_like(wanted)
    for k in range(wanted.size):
        missing = wanted[k] - state
        mean[k] = wanted[k] - missing * done / steps
        state += done * missing
    return state, mean


@frozen(kw_only=True)
class Charging(Insert):
    """A capacitance that is charged through a resistance; state: its voltage, V."""

    PLACE: ClassVar[Place] = "drive"

    resistance: float = quantity(gt(0.0), suffix="_ohm")
    capacitance: float = quantity(gt(0.0), suffix="_nf", scale=1e-9)

    @property
    def constant(self) -> float:
        """Time constant, s."""
        return self.resistance * self.capacitance

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """Discharged."""
        return 0.0


@frozen(kw_only=True)
class LaggingAmplifier(Charging):
    """An amplifier that charges the piezo through a resistance.

        R C dv/dt = u - v

    ``capacitance`` is the piezo's.
    """

    KIND: ClassVar[str] = "lagging_amplifier"

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        return follow(state, own, step / self.constant)


@frozen(kw_only=True)
class LimitedAmplifier(Charging):
    """An amplifier whose output stage limits the current into the piezo.

        C dv/dt = min(max((u - v) / R, -I), I)

    Far from u the voltage has the constant slope I / C. Within R I of u it approaches u as an
    exponential. ``current`` I in A; ``capacitance`` C is the piezo's.
    """

    KIND: ClassVar[str] = "limited_amplifier"

    current: float = quantity(gt(0.0), suffix="_ua", scale=1e-6)

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Mean voltage (V) across the piezo in each step."""
        slew = self.current / self.capacitance
        return _charge(state, own, slew, self.constant, step)


@compiled
def _charge(
    voltage: float, drive: Array, slew: float, constant: float, step: float
) -> tuple[float, Array]:
    mean = np.empty_like(drive)
    for k in range(drive.size):
        missing = drive[k] - voltage
        straight = min(max(abs(missing) / slew - constant, 0.0), step)
        run = np.sign(missing) * slew * straight
        rest, remaining = step - straight, missing - run
        closed = -remaining * np.expm1(-rest / constant)
        area = (missing - 0.5 * run) * straight + constant * closed
        mean[k] = drive[k] - area / step
        voltage += run + closed
    return voltage, mean


@frozen(kw_only=True)
class DelayedConverter(Insert):
    """A converter with a buffer: the drive reaches the scanner some time after its update.

        u_out(t) = u(t - delay)

    ``delay`` in s. A step in which the delayed drive changes carries the mean of both values.
    State: drive (V) in the queue, oldest first.
    """

    KIND: ClassVar[str] = "delayed_converter"
    PLACE: ClassVar[Place] = "drive"

    delay: float = quantity(ge(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Queue of a converter that was never written to."""
        return np.zeros(int(self.delay / step) + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Drive (V) that leaves the queue while ``own`` enters it."""
        waiting = np.concatenate((state, own))
        part = self.delay / step - (state.size - 1)
        leaving = (1.0 - part) * waiting[1 : own.size + 1] + part * waiting[: own.size]
        return waiting[own.size :], leaving


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
