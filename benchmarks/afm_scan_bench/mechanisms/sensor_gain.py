"""Mechanisms of the displacement sensor's gain."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Clocked, Insert, Place


@frozen(kw_only=True)
class FadingGain(Clocked):
    """A sensor whose gain falls while it warms up.

        x_read = x (1 - loss (1 - exp(-t / settling)))

    ``loss`` of the gain in the steady state, ``settling`` time (s).
    """

    KIND: ClassVar[str] = "fading_gain"
    PLACE: ClassVar[Place] = "displacement"

    loss: float = quantity()
    settling: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: it has just been turned on."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) as it is read."""
        return own * (1.0 + self.loss * np.expm1(-time / self.settling))


@frozen(kw_only=True)
class SaturatingSensor(Insert):
    """A sensor whose sensitivity falls towards the ends of its range, as an LVDT or a strain gauge.

        x_read = gain (arctan((x - offset) / reach) + arctan(offset / reach))
        gain = reach (1 + (offset / reach)^2), so that the slope at x = 0 is 1

    ``reach`` (m) of the arctangent, ``offset`` (m) of its middle. There is no state.
    """

    KIND: ClassVar[str] = "saturating_sensor"
    PLACE: ClassVar[Place] = "displacement"

    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    offset: float = quantity(suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        middle = self.offset / self.reach
        flat = np.arctan(own / self.reach - middle) + np.arctan(middle)
        return None, self.reach * (1.0 + middle**2) * flat


@frozen(kw_only=True)
class BurstingSupply(Clocked):
    """A sensor whose excitation voltage sags between two bursts of its switching supply.

        x_read = x gain,    gain = e^(-sag s) over its mean,    s from 0 to 1 between two bursts

    Under a light load a switching converter skips pulses: it charges its capacitor in a burst, and
    the load discharges it. The gain of a sensor that is not ratiometric is a sawtooth of this
    period. The period is unrelated to mains and scan. The error is zero at x = 0: a periodic change
    of the gain, where the catalogue has only added lines. ``sag`` (1) from burst to burst,
    ``bursts`` (Hz).
    Source: R. W. Erickson, D. Maksimovic, Fundamentals of Power Electronics, Springer 2020.
    """

    KIND: ClassVar[str] = "bursting_supply"
    PLACE: ClassVar[Place] = "displacement"

    sag: float = quantity(gt(0.0))
    bursts: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Share of the way between two bursts that had gone by at first."""
        return float(rng.uniform())

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Displacement (m) as it is read."""
        since = np.mod(drawn + self.bursts * time, 1.0)
        gain: Array = np.exp(-self.sag * since) * self.sag / -np.expm1(-self.sag)
        return own * gain


FLICKER_TONES = 60
FLICKER_LOWEST, FLICKER_HIGHEST = 0.5, 2000.0  # Hz


@frozen(kw_only=True)
class FlickeringReference(Clocked):
    """A sensor whose reference voltage has 1/f noise.

        x_read = x (1 + n),    n = amplitude sqrt(2 / TONES) sum cos(2 pi f_i t + phase_i)

    TONES is FLICKER_TONES. The gain fluctuates at random, so that the error is zero at x = 0. No
    catalogued effect describes noise of the gain. Tones of equal amplitude at log-uniform
    frequencies have a 1/f spectrum, and their sum is nearly Gaussian (Rice). ``amplitude`` (1),
    rms.
    Source: S. O. Rice, Bell System Technical Journal 23 (1944) 282.
    """

    KIND: ClassVar[str] = "flickering_reference"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity()

    def drawn(self, rng: np.random.Generator) -> Array:
        """Tones' frequencies (Hz) and phases (rad), shape (2, FLICKER_TONES)."""
        frequencies = FLICKER_LOWEST * (FLICKER_HIGHEST / FLICKER_LOWEST) ** rng.uniform(
            size=FLICKER_TONES
        )
        return np.stack((frequencies, rng.uniform(0.0, 2.0 * np.pi, FLICKER_TONES)))

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) by the reference of the moment."""
        noise = np.zeros(own.size)
        for frequency, phase in drawn.T:
            noise += np.cos(2.0 * np.pi * frequency * time + phase)
        gain: Array = 1.0 + self.amplitude * np.sqrt(2.0 / FLICKER_TONES) * noise
        return own * gain
