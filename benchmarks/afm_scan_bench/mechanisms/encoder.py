"""Mechanisms of encoders and of the sensor's converter: errors that depend on position."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, lt

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Clocked, Insert, Place

GHOST_SWING = 2.404826  # rad


@frozen(kw_only=True)
class GhostLight(Clocked):
    """A grating encoder into which light from a vibrating window falls.

        c = e^{i phi} + ghost e^{i theta},    phi = 2 pi x / period,
        theta = SWING sin(2 pi f t + phase)
        reading: x where c = e^{i phi}

    SWING is GHOST_SWING. The stray light adds to that of the grating with its own phase, and the
    electronics take the angle of the sum. The error is periodic in position and shifts with time.
    As SWING is the first zero of Bessel's J_0, no constant part remains. The error is neither a sum
    nor a product of functions of position and time: no catalogued effect describes it. ``period``
    (m) of the grating, ``ghost`` (1) relative to its light, frequency ``shaking`` (Hz) of the
    window.
    Source: C. Wu, R. D. Deslattes, Applied Optics 37 (1998) 6696 (periodic errors of
    interferometers).
    """

    KIND: ClassVar[str] = "ghost_light"
    PLACE: ClassVar[Place] = "displacement"

    period: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    ghost: float = quantity(ge(0.0), lt(1.0))
    shaking: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Phase (rad) of the window: it shakes already."""
        return float(rng.uniform(0.0, 2.0 * np.pi))

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Reading (m) for a displacement (m)."""
        turn = 2.0 * np.pi / self.period
        behind = GHOST_SWING * np.sin(2.0 * np.pi * self.shaking * time + drawn) - turn * own
        ahead = np.arctan2(self.ghost * np.sin(behind), 1.0 + self.ghost * np.cos(behind))
        read: Array = own + ahead / turn
        return read


MISS_SPACING = 40e-6  # m
MISSES = 300_000


@frozen(kw_only=True)
class MiscountingEncoder(Insert):
    """An incremental encoder whose counter misses a mark now and then.

        x_read = x - mark (marks missed on the way up - marks missed on the way down)

    Marks on the scale are counted as they pass. The travel between two misses is exponentially
    distributed with the mean MISS_SPACING, in either direction. A miss is a step of the reading
    that stays until a mark is missed on the way back. No catalogued effect has steps. ``mark``: m
    from one mark to the next.

    State: m travelled, marks missed upwards less downwards, last x (m), m of travel at each miss.
    Source: D. R. Cox, Renewal Theory, Methuen 1962.
    """

    KIND: ClassVar[str] = "miscounting_encoder"
    PLACE: ClassVar[Place] = "displacement"

    mark: float = quantity(suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[float, int, float, Array]:  # noqa: ARG002
        """It has just been set to zero; after what travel it will miss a mark is chance."""
        return 0.0, 0, 0.0, np.cumsum(rng.exponential(MISS_SPACING, MISSES))

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


SCRATCH_ANGLE = np.radians(40.0)  # of the scratch's normal to the axis
SCRATCH_OFFSET, SPOT_SIZE = (
    5e-6,
    2e-6,
)  # m, of the scratch from where the scanner rests, and of the light


@frozen(kw_only=True)
class ScratchedPlate(Insert):
    """A two-dimensional encoder whose grid plate has an oblique scratch.

        x_read = x + depth (e^(-(across / SPOT)^2 / 2) - its value at rest),
        across = x cos ANGLE + y sin ANGLE - OFFSET

    ANGLE, OFFSET and SPOT are SCRATCH_ANGLE, SCRATCH_OFFSET and SPOT_SIZE. The scratch shifts the
    phase of the light, weighted by the Gaussian profile of the spot. Each line crosses the scratch
    elsewhere. The error is a function of both axes, and no sum of functions of x, y and time: no
    catalogued effect describes it. ``depth`` (m) is the error in the middle of the scratch. There
    is no state.
    Source: W. Gao, Precision Nanometrology, Springer 2010 (surface encoders).
    """

    KIND: ClassVar[str] = "scratched_plate"
    PLACE: ClassVar[Place] = "displacement"

    depth: float = quantity(suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) as it is read."""
        across = own * np.cos(SCRATCH_ANGLE) + other * np.sin(SCRATCH_ANGLE) - SCRATCH_OFFSET
        return None, own + self.depth * (_light(across) - _light(-SCRATCH_OFFSET))


def _light(across: Array | float) -> Array:
    """Share of the spot's light at its middle, so far from it (m)."""
    return np.asarray(np.exp(-0.5 * (across / SPOT_SIZE) ** 2))


@frozen(kw_only=True)
class UnevenConverter(Insert):
    """A sensor's converter of which one bit has a wrong weight.

        x_read = x + error b(x),    b = the bit of this weight in the number x / weight, rounded

    The capacitors of a successive-approximation converter are matched only to so many bits: codes
    are missing or occur twice. The error is a square wave of x, of period 2 weight. ``weight`` (m)
    of the bit and its ``error`` (m). There is no state.
    """

    KIND: ClassVar[str] = "uneven_converter"
    PLACE: ClassVar[Place] = "displacement"

    weight: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    error: float = quantity(suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Reading (m) for a displacement (m)."""
        return None, own + self.error * np.mod(np.rint(own / self.weight), 2.0)
