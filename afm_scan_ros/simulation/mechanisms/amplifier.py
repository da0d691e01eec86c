"""Mechanisms of the drive: the converter, and the amplifier that charges the piezo.

The piezo is a capacitance. All solutions are exact while the converter holds its output.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert, Place


@compiled
def follow(state: float, wanted: Array, steps: float) -> tuple[float, Array]:
    """Follow an input through one time constant, exactly where the input is held.

    Returns the state at the end and its mean in each step, shape (n,). ``steps`` is the length of a
    step in time constants.
    """
    done = -np.expm1(-steps)
    mean = np.empty_like(wanted)
    for k in range(wanted.size):
        missing = wanted[k] - state
        mean[k] = wanted[k] - missing * done / steps
        state += done * missing
    return state, mean


@frozen(kw_only=True)
class Charging(Insert):
    """A capacitance that is charged through a resistance.

    ``resistance`` in Ohm, ``capacitance`` in F. State: voltage of the capacitance, V.
    """

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
