"""Mechanisms that change with time, whatever the drive is: floor, temperatures, and a load.

Some go on from scan to scan, with the time since the scanner was switched on. None of these
repeats with a scan, so that what an earlier scan showed cannot cancel them by replay.
"""

from typing import ClassVar

import numpy as np
from attrs import field, frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.attachment import Attached, AttachedStage, Attachment
from afm_scan_ros.simulation.mechanisms.base import Ageing, Clocked, Insert

ISOLATOR = (2.0 * np.pi * 25.0, 0.15)  # rad/s and damping ratio: rubber feet
LOOP = (2.0 * np.pi * 120.0, 0.02)


@frozen(kw_only=True)
class FloorVibration(Clocked):
    """A floor that shakes the microscope's table through its isolator, and the table the scanner.

        s'' = w_i^2 (floor - s) + 2 d_i w_i (floor' - s')    the table s on its isolator
        q'' + 2 d w q' + w^2 q = -s''                        the sample q, seen from the tip

    w and d belong to the mechanical loop from sample to tip, which is softer than the scanner
    alone. The floor moves as a sine of ``amplitude`` (m) at ``frequency`` (Hz) and its
    ``harmonics``: shares of the amplitude at 2, 3, ... times the frequency. Only the forced motion
    is computed. The phases are drawn anew for each scan.
    """

    KIND: ClassVar[str] = "floor_vibration"

    amplitude: float = quantity(suffix="_um", scale=1e-6)
    frequency: float = quantity(gt(0.0), suffix="_hz")
    harmonics: tuple[float, ...] = field()

    def drawn(self, rng: np.random.Generator) -> Array:
        """Phases (rad) of the floor's sines, which shakes already."""
        return rng.uniform(0.0, 2.0 * np.pi, 1 + len(self.harmonics))

    def at(self, time: Array, own: Array, drawn: Array) -> Array:
        """Displacement (m) while the table shakes."""
        shaken = own.copy()
        for i, share in enumerate((1.0, *self.harmonics)):
            s = 2j * np.pi * self.frequency * (i + 1)
            phasor = self.amplitude * share * _response(s) * np.exp(1j * drawn[i])
            shaken += np.imag(phasor * np.exp(s * time))
        return shaken


def _response(s: complex) -> complex:
    """Motion of the sample, seen from the tip, over that of the floor."""
    (isolator, loss), (loop, damping) = ISOLATOR, LOOP
    carried = 2.0 * loss * isolator * s + isolator**2
    table = carried / (s**2 + carried)
    return -(s**2) * table / (s**2 + 2.0 * damping * loop * s + loop**2)


@frozen(kw_only=True)
class WarmingFrame(Insert):
    """A frame that the room warms: heat flows from the air into the frame, and on into the stage.

        frame_tau dT_f/dt = T_room - T_f
        stage_tau dT_s/dt = T_f - T_s
        x_out = x + expansion (T_f - T_s)

    At the beginning of the scan the room becomes ``room_step`` (K) warmer; its temperature then
    rises at ``room_ramp`` (K/s). Frame and stage expand alike, so that only their temperature
    difference moves the sample. Integrated by a Runge-Kutta method of fourth order, in steps far
    below both time constants (s). ``expansion`` in m/K.

    State: temperatures of room, frame and stage above that at the beginning, K, shape (3,).
    """

    KIND: ClassVar[str] = "warming_frame"

    room_step: float = quantity(suffix="_k")
    room_ramp: float = quantity(suffix="_k_per_s")
    frame_tau: float = quantity(gt(0.0), suffix="_s")
    stage_tau: float = quantity(gt(0.0), suffix="_s")
    expansion: float = quantity(suffix="_um_per_k", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """The room has just become warmer, frame and stage have not."""
        return np.array([self.room_step, 0.0, 0.0])

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) carried along by the frame."""
        temperatures = state.copy()
        rates = (self.room_ramp, 1.0 / self.frame_tau, 1.0 / self.stage_tau)
        apart = _warm(temperatures, rates, step, own.size)
        return temperatures, own + self.expansion * apart


@compiled
def _warm(temperatures: Array, rates: tuple[float, float, float], step: float, count: int) -> Array:
    ramp, into_frame, into_stage = rates
    apart = np.empty(count)
    for k in range(count):
        room, frame, stage = temperatures
        apart[k] = frame - stage
        total_frame = total_stage = slope_frame = slope_stage = 0.0
        for share, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            at_frame = frame + share * step * slope_frame
            at_stage = stage + share * step * slope_stage
            slope_frame = into_frame * (room + share * step * ramp - at_frame)
            slope_stage = into_stage * (at_frame - at_stage)
            total_frame += weight * slope_frame
            total_stage += weight * slope_stage
        temperatures[0] = room + step * ramp
        temperatures[1] = frame + step / 6.0 * total_frame
        temperatures[2] = stage + step / 6.0 * total_stage
    return apart


class Elapsing(Ageing, Clocked):
    """A mechanism that depends only on the time since the scanner was switched on."""

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing differs from scan to scan but the age."""


@frozen(kw_only=True)
class SettlingFrame(Elapsing):
    """A frame that was warmed when the scanner was switched on, and comes to rest.

        x_out = x + speed tau (exp(-age / tau) - exp(-t / tau))

    ``speed`` (m/s) of the drift at first, ``tau`` (s) of its settling. At the beginning of a scan
    the coarse stage has brought the sample back, so that the drift counts from there.
    """

    KIND: ClassVar[str] = "settling_frame"

    speed: float = quantity(suffix="_um_per_s", scale=1e-6)
    tau: float = quantity(gt(0.0), suffix="_s")

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the frame."""
        left = self.speed * np.exp(-self.age / self.tau)
        drifted: Array = own - left * self.tau * np.expm1(-time / self.tau)
        return drifted


@frozen(kw_only=True)
class SwingingRoom(Elapsing):
    """A room whose temperature goes up and down: the drift reverses.

        x_out = x + speed period / (2 pi) (sin(2 pi t / period) - sin(2 pi age / period))

    ``speed`` (m/s) is the largest, which it has at first; ``period`` in s. At the beginning of a
    scan the coarse stage has brought the sample back, so that the drift counts from there.
    """

    KIND: ClassVar[str] = "swinging_room"

    speed: float = quantity(suffix="_um_per_s", scale=1e-6)
    period: float = quantity(gt(0.0), suffix="_s")

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the frame."""
        turn = 2.0 * np.pi / self.period
        swung = np.sin(turn * (time + self.age)) - np.sin(turn * self.age)
        drifted: Array = own + self.speed / turn * swung
        return drifted


@frozen(kw_only=True)
class WarmingPiezo(Elapsing):
    """A piezo that becomes warmer, so that its gain changes.

        x_out = x (1 + share (1 - exp(-t / tau)))

    ``share`` (1) by which the gain has changed in the end, ``tau`` (s) of the warming.
    """

    KIND: ClassVar[str] = "warming_piezo"

    share: float = quantity(gt(-1.0))
    tau: float = quantity(gt(0.0), suffix="_s")

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) of the piezo as warm as it is."""
        warmer: Array = own * (1.0 - self.share * np.expm1(-(time + self.age) / self.tau))
        return warmer


@frozen(eq=False)
class ChangingMass(Attached):
    """A mass fixed to the stage that changes evenly with time.

    ``masses`` (1) before and after, over the moving mass; ``times`` (s) since the beginning of the
    scan at which the change begins and ends. With the force of the drive taken out,

        (1 + m) u'' + 2 d w u' + w^2 u = -m x_d''

    and with v = (1 + m) u' + m x_d', which needs no second derivative of x_d,

        v' = m' (u' + x_d') - 2 d w u' - w^2 u,    u' = (v - m x_d') / (1 + m)

    State: u (m) and v (m/s), and the steps since the beginning.
    """

    masses: tuple[float, float]
    times: tuple[float, float]

    def own_at_rest(self) -> Array:
        """The scan begins."""
        return np.zeros(1)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """Displacement u (m) that the mass adds."""
        stage = (self.stage.natural, self.stage.damping)
        return _integrate(state, path[0], step, stage, (*self.masses, *self.times))


@frozen(kw_only=True)
class ChangingLoad(Ageing, Attachment):
    """A load on the stage that changes: a sample that is exchanged, dries, or takes up liquid.

        (1 + m) x'' + 2 d w x' + w^2 x = w^2 x_driven

    so that the first resonance is at w / sqrt(1 + m), with a damping of d / sqrt(1 + m). The mass m
    goes from ``mass_ratio_before`` to ``mass_ratio_after`` (over the moving mass) between ``begin``
    and ``end`` (s since the scanner was switched on), evenly in time.

    Raises InputError where the end is not after the beginning.
    """

    KIND: ClassVar[str] = "changing_load"

    mass_ratio_before: float = quantity(gt(-0.9))
    mass_ratio_after: float = quantity(gt(-0.9))
    begin: float = quantity(suffix="_s")
    end: float = quantity(suffix="_s")

    def __attrs_post_init__(self) -> None:
        if not self.begin < self.end:
            raise InputError(
                f"end = {self.end:g} s is not after begin = {self.begin:g} s: give more"
            )

    def attached(self, stage: AttachedStage) -> ChangingMass:
        """Mass on the axis, as old as the scanner."""
        masses = self.mass_ratio_before, self.mass_ratio_after
        return ChangingMass(self.row, stage, masses, (self.begin - self.age, self.end - self.age))


@compiled
def _integrate(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    change: tuple[float, float, float, float],
) -> Array:
    u = np.empty(path.size - 1)
    for k in range(u.size):
        speed = (path[k + 1] - path[k]) / step
        at_u, at_v = state[0], state[1]
        total_u = total_v = slope_u = slope_v = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            mass, rate = _mass((state[2] + ahead) * step, change)
            trial_u, trial_v = at_u + ahead * step * slope_u, at_v + ahead * step * slope_v
            slope_u = (trial_v - mass * speed) / (1.0 + mass)
            natural, damping = stage
            slope_v = rate * (slope_u + speed) - 2.0 * damping * natural * slope_u
            slope_v -= natural**2 * trial_u
            total_u += weight * slope_u
            total_v += weight * slope_v
        state[0] = at_u + step / 6.0 * total_u
        state[1] = at_v + step / 6.0 * total_v
        state[2] += 1.0
        u[k] = state[0]
    return u


@compiled
def _mass(time: float, change: tuple[float, float, float, float]) -> tuple[float, float]:
    """Mass (1) and its slope (1/s) at a time (s)."""
    before, after, begin, end = change
    if time <= begin:
        return before, 0.0
    if time >= end:
        return after, 0.0
    slope = (after - before) / (end - begin)
    return before + slope * (time - begin), slope
