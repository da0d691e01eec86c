"""Mechanisms that are attached to the structure and act back on it.

The displacement x_d under the piezo and the displacement u under an attachment's force f are
superposed,

    x = x_d + u,    u'' + 2 d w u' + w^2 u = w^2 f,

with w and d of the axis' first resonance. f is in metres: the static displacement that the force
would cause if it stayed. As f depends on x, the resonances of the whole differ from those of the
parts. Integrated by a Runge-Kutta method of fourth order unless stated; x_d is linear within a
step.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from attrs import field, frozen
from attrs.validators import deep_iterable, ge, gt, min_len

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Mechanism


@frozen
class AttachedStage:
    """First resonance of an axis: ``natural`` frequency (rad/s) and ``damping`` ratio."""

    natural: float
    damping: float

    @classmethod
    def of_pole(cls, pole: complex) -> "AttachedStage":
        """Resonance with this pole, 1/s."""
        return cls(abs(pole), -pole.real / abs(pole))


@frozen(eq=False)
class Attached(ABC):
    """An attachment at ``stage``, on axis ``row`` of the chain.

    State: u (m), u' (m/s) and the attachment's own state, shape (2 + m,), and the last x_d of the
    axis and of the other one, m, shape (2, 1).
    """

    row: int
    stage: AttachedStage

    @abstractmethod
    def own_at_rest(self) -> Array:
        """State of the attachment itself, shape (m,)."""

    @abstractmethod
    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) at each but the first of the instants of ``path``; ``state`` becomes the last.

        ``path`` is x_d of the axis and displacement of the other one, m, shape (2, n + 1).
        """

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[Array, Array]:  # noqa: ARG002
        """Nothing moves."""
        return np.concatenate((np.zeros(2), self.own_at_rest())), np.zeros((2, 1))

    def apply(self, state: Any, signals: Array, step: float) -> tuple[Any, Array]:  # noqa: ANN401
        """Displacements (m) with the attachment, both axes, shape (2, n)."""
        moving, last = state
        moving, signals = moving.copy(), signals.copy()
        order = [self.row, 1 - self.row]
        path = np.concatenate((last, signals[order]), axis=1)
        signals[self.row] += self.integrate(moving, path, step)
        return (moving, path[:, -1:]), signals


class Attachment(Mechanism):
    """A mechanism that is attached to the structure."""

    @abstractmethod
    def attached(self, stage: AttachedStage) -> Attached:
        """The attachment at an axis of this resonance."""


@frozen(eq=False)
class SprungBody(Attached):
    """A body on a spring with losses that the axes carry, and that acts back on one of them.

        q'' + 2 d_b w_b (q' - carried') + w_b^2 (q - carried) = 0,    carried = a x + b y
        f = stiffness ((q - a x) + 2 d_b / w_b (q' - a x'))

    x is the axis that feels the body, y the other one. ``natural`` frequency w_b (rad/s),
    ``damping`` ratio d_b, ``shares`` a and b, ``stiffness`` (1) in units of the axis' own.

    Its own state: q (m) and q' (m/s).
    """

    natural: float
    damping: float
    shares: tuple[float, float]
    stiffness: float

    def own_at_rest(self) -> Array:
        """At rest where it is carried."""
        return np.zeros(2)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while body and axis move."""
        stage = (self.stage.natural, self.stage.damping)
        body = (self.natural, self.damping, *self.shares, self.stiffness)
        return _integrate(state, path, step, stage, body)


@compiled
def _integrate(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    body: tuple[float, float, float, float, float],
) -> Array:
    u = np.empty(path.shape[1] - 1)
    slope, trial, total = np.zeros(4), np.zeros(4), np.zeros(4)
    for k in range(u.size):
        slope[:] = 0.0
        total[:] = state
        x_speed = (path[0, k + 1] - path[0, k]) / step
        y_speed = (path[1, k + 1] - path[1, k]) / step
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            x = path[0, k] + ahead * (path[0, k + 1] - path[0, k])
            y = path[1, k] + ahead * (path[1, k + 1] - path[1, k])
            for i in range(4):
                trial[i] = state[i] + ahead * step * slope[i]
            _slopes(trial, (x, x_speed), (y, y_speed), stage, body, slope)
            for i in range(4):
                total[i] += step / 6.0 * weight * slope[i]
        state[:] = total
        u[k] = state[0]
    return u


@compiled
def _slopes(
    state: Array,
    x: tuple[float, float],
    y: tuple[float, float],
    stage: tuple[float, float],
    body: tuple[float, float, float, float, float],
    slope: Array,
) -> None:
    """Slopes of the state; ``x`` and ``y`` are path and speed under the piezo."""
    u, u_speed, q, q_speed = state
    natural, damping = stage
    own, loss, from_x, from_y, stiffness = body
    below, below_speed = from_x * (x[0] + u), from_x * (x[1] + u_speed)
    lag = 2.0 * loss / own
    force = stiffness * ((q - below) + lag * (q_speed - below_speed))
    slope[0] = u_speed
    slope[1] = natural**2 * (force - u) - 2.0 * damping * natural * u_speed
    slope[2] = q_speed
    carried = below + from_y * y[0]
    carried_speed = below_speed + from_y * y[1]
    slope[3] = own**2 * ((carried - q) + lag * (carried_speed - q_speed))


@frozen(eq=False)
class Parts(Attached):
    """Springs of ``share`` (1) altogether, which yield or slip at ``reaches`` (m)."""

    share: float
    reaches: Array

    def own_at_rest(self) -> Array:
        """None is bent."""
        return np.zeros(self.reaches.size)


@frozen(kw_only=True)
class YieldingAttachment(Attachment):
    """Several springs (``PARTS``), all equally stiff, that yield or slip one after another."""

    PARTS: ClassVar[type[Parts]]

    share: float = quantity(ge(0.0))
    reaches: tuple[float, ...] = field(
        validator=[min_len(1), deep_iterable(gt(0.0))], metadata={"suffix": "_um", "scale": 1e-6}
    )

    def attached(self, stage: AttachedStage) -> Parts:
        """Parts that are all equally stiff."""
        return self.PARTS(self.row, stage, self.share, np.array(self.reaches))
