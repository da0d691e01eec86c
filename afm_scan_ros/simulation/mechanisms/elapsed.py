"""Mechanisms that change with the time since the scanner was switched on, from scan to scan too.

None of them repeats with a scan, so that what an earlier scan showed cannot cancel them by replay.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.attachment import Attached, AttachedStage, Attachment
from afm_scan_ros.simulation.mechanisms.base import Ageing, Clocked


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
