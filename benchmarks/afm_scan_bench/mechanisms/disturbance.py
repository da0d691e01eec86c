"""Disturbances that neither drive nor scan cause."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import ComplexArray, quantity
from afm_scan_ros.simulation.mechanisms.base import Clocked, Insert, Place

BUBBLES = 150.0  # 1/s
BUBBLE_COUNT, BOILING_BEFORE = 300_000, 1.0  # in all; s that it has boiled for when the scan begins
CRYOSTAT_INSERT = (2.0 * np.pi * 120.0, 0.15)  # rad/s and damping ratio
CRYOSTAT_ROOT = np.sqrt(1.0 - CRYOSTAT_INSERT[1] ** 2)
CRYOSTAT_POLE = CRYOSTAT_INSERT[0] * (1j * CRYOSTAT_ROOT - CRYOSTAT_INSERT[1])


@frozen(kw_only=True)
class BoilingCryostat(Clocked):
    """A cryostat whose nitrogen boils: bubbles knock at the insert at random.

        z'' + 2 d w z' + w^2 z = w amplitude (an impulse for each bubble),    x_out = x + z

    Bubbles are independent, BUBBLES a second on average, of exponentially distributed size with the
    mean ``amplitude``. This is shot noise in the band where the insert rings (CRYOSTAT_INSERT): no
    periodic line. ``amplitude`` (m) that a bubble of mean size would cause without damping.
    Source: N. R. Campbell, Proc. Cambridge Phil. Soc. 15 (1909) 117.
    """

    KIND: ClassVar[str] = "boiling_cryostat"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)

    def drawn(self, rng: np.random.Generator) -> tuple[Array, ComplexArray]:
        """When bubbles knock (s), and how the insert rings right after each, for a long while."""
        waits, sizes = (
            rng.exponential(1.0 / BUBBLES, BUBBLE_COUNT),
            rng.exponential(1.0, BUBBLE_COUNT),
        )
        return np.cumsum(waits) - BOILING_BEFORE, _rings(np.exp(CRYOSTAT_POLE * waits), sizes)

    def at(self, time: Array, own: Array, drawn: tuple[Array, ComplexArray]) -> Array:
        """Displacement (m) while the insert rings."""
        knocks, rings = drawn
        if time[-1] >= knocks[-1]:
            raise InputError(
                f"boiling_cryostat: the scan outlasts {BUBBLE_COUNT} bubbles: it lasts"
                f" {knocks[-1]:.3g} s at most"
            )
        last = np.searchsorted(knocks, time, side="right") - 1
        ringing: Array = (
            np.imag(rings[last] * np.exp(CRYOSTAT_POLE * (time - knocks[last]))) / CRYOSTAT_ROOT
        )
        return own + self.amplitude * ringing


@compiled
def _rings(kept: ComplexArray, sizes: Array) -> ComplexArray:
    rings = np.empty_like(kept)
    ring = 0.0j
    for k in range(sizes.size):
        ring = ring * kept[k] + sizes[k]
        rings[k] = ring
    return rings


VALVE_STIFFNESS, VALVE_PERIOD = 3.0, 8.85909550  # of the equation, and of its cycle
VALVE_ROUNDS, VALVE_STEPS = 6, 20_000  # cycles until it goes round, and steps for them


@frozen(kw_only=True)
class ChatteringValve(Insert):
    """A relief valve in the cooling water that chatters: a relaxation oscillation.

        z'' - STIFFNESS (1 - z^2) z' + z = 0,    x_out = x + amplitude z

    STIFFNESS is VALVE_STIFFNESS. The oscillation has every odd harmonic of ``frequency`` (Hz) and
    is independent of drive and scan. The time unit of the equation is the cycle's period over
    VALVE_PERIOD. Runge-Kutta method of fourth order. ``amplitude`` (m), half of what z reaches.
    State: z and z', shape (2,).
    Source: B. van der Pol, Philosophical Magazine 2 (1926) 978.
    """

    KIND: ClassVar[str] = "chattering_valve"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)
    frequency: float = quantity(gt(0.0), suffix="_hz")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Somewhere on its cycle: it chatters already."""
        state = np.array([2.0, 0.0])
        _turn(
            state,
            np.empty(VALVE_STEPS),
            (VALVE_ROUNDS + rng.uniform()) * VALVE_PERIOD / VALVE_STEPS,
        )
        return state

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what the valve shakes it by."""
        state, shaken = state.copy(), np.empty_like(own)
        _turn(state, shaken, step * self.frequency * VALVE_PERIOD)
        return state, own + self.amplitude * shaken


@compiled
def _turn(state: Array, path: Array, ahead: float) -> None:
    """Z at the beginning of each step ``ahead``."""
    place, speed = state
    for k in range(path.size):
        path[k] = place
        moved = gained = z_slope = s_slope = 0.0
        for part, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            z, s = place + part * z_slope, speed + part * s_slope
            z_slope, s_slope = ahead * s, ahead * (VALVE_STIFFNESS * (1.0 - z * z) * s - z)
            moved += weight / 6.0 * z_slope
            gained += weight / 6.0 * s_slope
        place, speed = place + moved, speed + gained
    state[:] = place, speed


COMPRESSOR_FRAME = (2.0 * np.pi * 70.0, 0.08)  # rad/s and damping ratio


@frozen(kw_only=True)
class ThumpingCompressor(Clocked):
    """A compressor whose strokes strike the frame, which rings down between them.

        z'' + 2 d w z' + w^2 z = sum over the strokes of an impulse,    x_out = x + z

    The response is in its steady state: the rings of all earlier strokes are a geometric series.
    The lines are at the strokes' frequency and its multiples, the highest near the frame's own
    frequency. ``amplitude`` (m) that a stroke would cause without damping, ``strokes`` (Hz).
    """

    KIND: ClassVar[str] = "thumping_compressor"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)
    strokes: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Share of a stroke's period that had gone by at first: it runs already."""
        return float(rng.uniform())

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Displacement (m) while the frame rings."""
        since = np.mod(drawn + self.strokes * time, 1.0) / self.strokes
        (frame, damping), root = COMPRESSOR_FRAME, np.sqrt(1.0 - COMPRESSOR_FRAME[1] ** 2)
        s = frame * (1j * root - damping)
        ringing: Array = np.imag(np.exp(s * since) / (1.0 - np.exp(s / self.strokes)))
        return own + self.amplitude * ringing


BALLS, RATIO = 8, 0.27  # how many, and their diameter over that of the circle they run on
PASSES = 0.5 * BALLS * (1.0 - RATIO)
BEARING_FRAME = (2.0 * np.pi * 130.0, 0.06)  # rad/s and damping ratio


@frozen(kw_only=True)
class WornBearing(Clocked):
    """A fan with a pit in the outer race of its bearing, on an unbalanced shaft.

        z'' + 2 d w z' + w^2 z = w^2 amplitude cos(2 pi shaft t + phase)
                                 + w amplitude (an impulse for each ball over the pit)
        x_out = x + z

    The balls' cage turns at less than half the shaft's speed: PASSES balls cross a place of the
    outer race in each turn of the shaft, which is not an integer. So there are two sets of lines
    without a common fundamental. The response is in its steady state. ``amplitude`` (m) of an
    impact without damping, and of the unbalance; ``shaft`` (Hz).
    Source: P. D. McFadden, J. D. Smith, J. Sound and Vibration 96 (1984) 69.
    """

    KIND: ClassVar[str] = "worn_bearing"
    PLACE: ClassVar[Place] = "displacement"

    amplitude: float = quantity(suffix="_nm", scale=1e-9)
    shaft: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> Array:
        """Share of the way between balls, and of a turn, gone by at first: it runs already."""
        return rng.uniform(size=2)

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) while the frame shakes."""
        natural, damping = BEARING_FRAME
        passing, turn = PASSES * self.shaft, 2j * np.pi * self.shaft
        since = np.mod(drawn[0] + passing * time, 1.0) / passing
        s = natural * (1j * np.sqrt(1.0 - damping**2) - damping)
        rings = np.exp(s * since) / (1.0 - np.exp(s / passing))
        answer = natural**2 / (turn**2 + 2.0 * damping * natural * turn + natural**2)
        unbalance = answer * np.exp(turn * time + 2j * np.pi * drawn[1])
        shaken: Array = np.imag(rings) / np.sqrt(1.0 - damping**2) + np.real(unbalance)
        return own + self.amplitude * shaken


@frozen(kw_only=True)
class SupplyRipple(Clocked):
    """A supply whose ripple adds to the drive: rectified mains.

        u_out = u + amplitude |sin(pi f t + phase)|, its mean removed

    The ripple has every multiple of f, twice the mains frequency. It passes through hysteresis and
    structure as the drive does. ``amplitude`` (V) of the rectified sine, its ``frequency`` f (Hz).
    """

    KIND: ClassVar[str] = "supply_ripple"
    PLACE: ClassVar[Place] = "drive"

    amplitude: float = quantity(suffix="_v")
    frequency: float = quantity(gt(0.0), suffix="_hz")

    def drawn(self, rng: np.random.Generator) -> float:
        """Phase (rad) of the sine: it hums already."""
        return float(rng.uniform(0.0, np.pi))

    def at(self, time: Array, own: Array, drawn: float) -> Array:
        """Drive (V) with the ripple."""
        ripple = np.abs(np.sin(np.pi * self.frequency * time + drawn)) - 2.0 / np.pi
        return own + self.amplitude * ripple


POPS = 100_000


@frozen(kw_only=True)
class PoppingMount(Clocked):
    """A mount that jumps between two positions: a random telegraph signal.

        x_out = x + jump s,    s = 0 or 1, which changes with probability dt / dwell

    Causes are glue that cracks, a wire that touches, or a charge in the sensor. ``jump`` (m), mean
    ``dwell`` (s) at each position.
    """

    KIND: ClassVar[str] = "popping_mount"
    PLACE: ClassVar[Place] = "displacement"

    jump: float = quantity(suffix="_nm", scale=1e-9)
    dwell: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> Array:
        """When it pops (s), for a long while; it begins at one rest."""
        return np.cumsum(rng.exponential(self.dwell, POPS))

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) with the jumps so far."""
        if time[-1] > drawn[-1]:
            raise InputError(f"popping_mount: the scan outlasts {POPS} pops: make dwell_s longer")
        return own + self.jump * (np.searchsorted(drawn, time, side="right") % 2)
