"""What the environment does to a microscope: the floor shakes it, and the room warms it."""

from typing import ClassVar

import numpy as np
from attrs import field, frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Clocked, Insert

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
