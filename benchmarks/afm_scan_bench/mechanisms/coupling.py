"""Mechanisms by which the other axis moves this one."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt, in_, lt, not_

from afm_scan_bench.mechanisms.linear import Stepping
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.attachment import Attached, AttachedStage, Attachment
from afm_scan_ros.simulation.mechanisms.base import Insert, Place

FLEXURES = 2.0 * np.pi * 260.0  # rad/s, of the stage's mass on the other axis' flexures


@frozen(kw_only=True)
class YawingStage(Insert):
    """A stage that yaws as the other axis pushes it off its centre, and a sensor off its axis.

        inertia theta'' + c theta' + kappa theta = offset (k y + m y'')
        x_read = x + arm theta

    Abbe's error. The force bends the other axis' flexures and accelerates the stage; the ``offset``
    of its line from the centre turns the stage. With z'' + 2 d w z' + w^2 z = w^2 y of the yaw's
    own resonance and FLEXURES^2 = k / m, arm theta = share (z + z'' / FLEXURES^2). Exact for a y
    that is linear within a step. ``share`` of the other axis that is read at low frequency;
    ``frequency`` (Hz) and ``damping`` ratio of the yaw.

    State: z (m), z' (m/s) and the last y, m, shape (3,).
    Source: E. Abbe, Zeitschrift fuer Instrumentenkunde 10 (1890) 446.
    """

    KIND: ClassVar[str] = "yawing_stage"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity()
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing has turned."""
        return np.zeros(3)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:
        """Displacement (m) as it is read."""
        natural = 2.0 * np.pi * self.frequency
        loss = 2.0 * self.damping * natural
        flow, entry = np.array([[0.0, 1.0], [-(natural**2), -loss]]), np.array([0.0, natural**2])
        path = np.concatenate((state[2:], other))
        turned = Stepping.of(flow, entry, step).run(state[:2], path)
        z, speed = turned.T
        pushed = natural**2 * (other - z) - loss * speed
        after = np.array([z[-1], speed[-1], other[-1]])
        return after, own + self.share * (z + pushed / FLEXURES**2)


HOSE_SETTLING = np.array([1e-3, 1e-2, 1e-1, 1.0])  # s


@frozen(kw_only=True)
class TuggingHose(Attachment):
    """A rubber hose of the sample's cell that the other axis stretches.

        e = y + relaxing mean(h_i),    h_i' = y' - h_i / SETTLING_i,    x feels share e

    SETTLING is HOSE_SETTLING. Rubber is stiffer at higher speed and relaxes over several decades of
    time (Prony's series of Maxwell elements). The hose runs almost along y, so that only y
    stretches it: a cross coupling that depends on past y. Exact for a y that is linear within a
    step; solved for g_i = h_i - y, as y' does not enter its equation. ``share`` of the other axis'
    displacement at low frequency; ``relaxing`` share of the hose's force.
    Source: R. M. Christensen, Theory of Viscoelasticity, Academic Press 1982, 1.
    """

    KIND: ClassVar[str] = "tugging_hose"

    share: float = quantity()
    relaxing: float = quantity(ge(0.0))

    def attached(self, stage: AttachedStage) -> "Hose":
        """Hose from the other axis to this one."""
        return Hose(self.row, stage, self.share, self.relaxing)


@frozen(eq=False)
class Hose(Attached):
    """A hose of ``share`` (1) that pulls by ``relaxing`` (1) more at once; its state: g (m)."""

    share: float
    relaxing: float

    def own_at_rest(self) -> Array:
        """Never drawn."""
        return np.zeros(HOSE_SETTLING.size)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the other axis pulls."""
        states = Stepping.of(*self._equations(), step).run(state, path[1])
        state[:] = states[-1]
        return states[:, 0].copy()

    def _equations(self) -> tuple[Array, Array]:
        """A and b of the state u, u', g under y."""
        stage, count = self.stage, HOSE_SETTLING.size
        pull = stage.natural**2 * self.share
        flow, entry = np.zeros((2 + count, 2 + count)), np.zeros(2 + count)
        flow[0, 1] = 1.0
        flow[1, :2] = -(stage.natural**2), -2.0 * stage.damping * stage.natural
        flow[1, 2:] = pull * self.relaxing / count
        flow[2:, 2:] = -np.diag(1.0 / HOSE_SETTLING)
        entry[1] = pull * (1.0 + self.relaxing)
        entry[2:] = -1.0 / HOSE_SETTLING
        return flow, entry


@frozen(kw_only=True)
class SwingingArm(Insert):
    """An arm that swings with the other axis: the tip runs on an arc.

        x_out = x + y^2 / (2 radius)

    ``radius`` of the arc, m, negative to the other side. There is no state.
    """

    KIND: ClassVar[str] = "swinging_arm"
    PLACE: ClassVar[Place] = "displacement"

    radius: float = quantity(
        not_(in_((0.0,)), msg="an arc of radius 0 is none"), suffix="_um", scale=1e-6
    )

    def at_rest(self, step: float, rng: np.random.Generator) -> None:
        """Remember nothing."""

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) on the arc."""
        return None, own + other**2 / (2.0 * self.radius)
