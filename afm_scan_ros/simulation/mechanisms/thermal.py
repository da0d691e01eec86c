"""Thermal mechanisms: drift."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert


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
