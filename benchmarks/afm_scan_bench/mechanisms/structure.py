"""Mechanisms of the structure: further modes, flexures and stops."""

from typing import ClassVar

import numpy as np
from attrs import evolve, frozen
from attrs.validators import ge, gt, lt

from afm_scan_bench.mechanisms.linear import Stepping
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import AxisSpec, RationalSpec, detuned_axis, quantity
from afm_scan_ros.simulation.mechanisms.attachment import Attached, AttachedStage, Attachment
from afm_scan_ros.simulation.mechanisms.base import Alteration, Insert, Place


@frozen(kw_only=True)
class GluedMirror(Attachment):
    """The sensor's mirror on a viscoelastic glue: a mass on a Zener solid.

        m q'' = -p,    p = k (q - x) + relaxing k h,    h' = q' - x' - h / settling

    The scanner feels p. At high frequency the glue is stiffer by the share ``relaxing``, and its
    dashpot damps the mirror: a further resonance that acts back on the structure. Exact for a
    motion under the piezo that is linear within a step; solved for g = h - (q - x) in place of h,
    as x' does not enter its equation. ``mass_ratio`` to the moving mass, ``frequency`` (Hz) of m on
    k, ``settling`` (s) of the glue.
    Source: J. D. Ferry, Viscoelastic Properties of Polymers, 1980.
    """

    KIND: ClassVar[str] = "glued_mirror"

    mass_ratio: float = quantity(ge(0.0))
    frequency: float = quantity(gt(0.0), suffix="_hz")
    relaxing: float = quantity(gt(0.0))
    settling: float = quantity(gt(0.0), suffix="_ms", scale=1e-3)

    def attached(self, stage: AttachedStage) -> "Glued":
        """Mirror on the axis."""
        natural = 2.0 * np.pi * self.frequency
        return Glued(self.row, stage, self.mass_ratio, natural, self.relaxing, self.settling)


@frozen(eq=False)
class Glued(Attached):
    """``mass`` over that of the axis, ``natural`` (rad/s), ``relaxing`` (1), ``settling`` (s).

    State of its own: q (m), q' (m/s), g (m).
    """

    mass: float
    natural: float
    relaxing: float
    settling: float

    def own_at_rest(self) -> Array:
        """The mirror where the scanner is, and nothing to relax."""
        return np.zeros(3)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while mirror and axis move."""
        states = Stepping.of(*self._equations(), step).run(state, path[0])
        state[:] = states[-1]
        return states[:, 0].copy()

    def _equations(self) -> tuple[Array, Array]:
        """A and b of the state u, u', q, q', g under x_d: p / k is a (q - u - x_d) + relaxing g."""
        fast, stage = 1.0 + self.relaxing, self.stage
        pull = self.mass * self.natural**2
        glue = np.array([-fast, 0.0, fast, 0.0, self.relaxing])
        flow = np.zeros((5, 5))
        flow[0, 1] = flow[2, 3] = 1.0
        flow[1] = pull * glue
        flow[1, :2] -= stage.natural**2, 2.0 * stage.damping * stage.natural
        flow[3] = -(self.natural**2) * glue
        flow[4] = np.array([1.0, 0.0, -1.0, 0.0, -1.0]) / self.settling
        entry = np.array([0.0, -pull * fast, 0.0, self.natural**2 * fast, 1.0 / self.settling])
        return flow, entry


@frozen(kw_only=True)
class SprungHolder(Insert):
    """A light sample holder on a spring, in series with the stage.

        q'' + 2 d w (q' - x') + w^2 (q - x) = 0,    x_out = q

    The holder does not act back on the stage. Runge-Kutta method of fourth order, x linear within a
    step. ``frequency`` (Hz) and ``damping`` ratio. State: q (m), q' (m/s) and the last x (m).
    """

    KIND: ClassVar[str] = "sprung_holder"
    PLACE: ClassVar[Place] = "displacement"

    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing moves."""
        return np.zeros(3)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the holder."""
        state = state.copy()
        return state, _swing(state, own, step, 2.0 * np.pi * self.frequency, self.damping)


@compiled
def _swing(state: Array, x: Array, step: float, natural: float, damping: float) -> Array:
    path = np.empty_like(x)
    for k in range(x.size):
        place, speed, last = state
        pace = (x[k] - last) / step
        total_place = total_speed = slope_place = slope_speed = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            q, v = place + ahead * step * slope_place, speed + ahead * step * slope_speed
            away = last + ahead * step * pace - q
            slope_place = v
            slope_speed = natural**2 * away + 2.0 * damping * natural * (pace - v)
            total_place += weight * slope_place
            total_speed += weight * slope_speed
        state[0] = place + step / 6.0 * total_place
        state[1] = speed + step / 6.0 * total_speed
        state[2] = x[k]
        path[k] = state[0]
    return path


CABLE_TERMS = 5
CABLE_ORDERS = np.arange(1, CABLE_TERMS + 1, dtype=np.float64)


@frozen(kw_only=True)
class TautCable(Attachment):
    """A taut cable from the sample to the frame: a series of modes.

        mass w_tt + loss w_t = tension w_ss,    w(0) = x,    w(length) = 0
        x feels tension (w_s(0) + x / length)

    The stage excites the cable at ``frequency`` and its multiples, and the cable acts back on it.
    With s in lengths and r_n the integral of 2 w sin(n pi s),

        r_n'' + 2 d w_1 r_n' + w_n^2 (r_n - 2 x / (n pi)) = 0,    w_n = n w_1
        x feels share sum (n pi r_n - 2 x)

    of which the first CABLE_TERMS are kept. The axis' stiffness, as stated, includes the static
    force. ``share``: tension over length, in units of the axis' stiffness; ``frequency`` (Hz) of
    the cable's first mode, and ``damping`` ratio d there.
    Source: P. M. Morse, Vibration and Sound, McGraw-Hill 1948, 9 and 13.
    """

    KIND: ClassVar[str] = "taut_cable"

    share: float = quantity(ge(0.0))
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def attached(self, stage: AttachedStage) -> "Cable":
        """Cable at the axis."""
        natural = 2.0 * np.pi * self.frequency
        return Cable(self.row, stage, self.share, natural, self.damping)


@frozen(eq=False)
class Cable(Attached):
    """``share`` (1), ``natural`` (rad/s) and ``damping`` ratio of the first mode.

    State of its own: r (m) and r' (m/s).
    """

    share: float
    natural: float
    damping: float

    def own_at_rest(self) -> Array:
        """Straight."""
        return np.zeros(2 * CABLE_TERMS)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while cable and axis swing."""
        states = Stepping.of(*self._equations(), step).run(state, path[0])
        state[:] = states[-1]
        return states[:, 0].copy()

    def _equations(self) -> tuple[Array, Array]:
        """A and b of the state u, u', r, r' under x_d."""
        stage, swings = self.stage, (self.natural * CABLE_ORDERS) ** 2
        flow, entry = (
            np.zeros((2 + 2 * CABLE_TERMS, 2 + 2 * CABLE_TERMS)),
            np.zeros(2 + 2 * CABLE_TERMS),
        )
        bends, speeds = slice(2, 2 + CABLE_TERMS), slice(2 + CABLE_TERMS, None)
        flow[0, 1] = 1.0
        flow[1, bends] = stage.natural**2 * self.share * np.pi * CABLE_ORDERS
        flow[bends, speeds] = np.eye(CABLE_TERMS)
        flow[speeds, bends] = -np.diag(swings)
        flow[speeds, speeds] = -2.0 * self.damping * self.natural * np.eye(CABLE_TERMS)
        entry[1] = -2.0 * CABLE_TERMS * stage.natural**2 * self.share
        entry[speeds] = swings * 2.0 / (np.pi * CABLE_ORDERS)
        flow[:, 0] += entry  # u moves the cable's end as x_d does
        flow[1, :2] -= stage.natural**2, 2.0 * stage.damping * stage.natural
        return flow, entry


@frozen(kw_only=True)
class CrackedLeaf(Alteration):
    """A cracked leaf of the flexures: the structure is softer than before.

        k' = (1 - loss) k:    d' = d / (1 - loss),    w' = w (1 - loss)^(1/2),    D' = D w / w'

    The same force moves the structure further, and the same mass and dashpot have a lower
    frequency: gain, resonance and damping ratio shift together. The further modes have leaves of
    their own and stay. ``loss``: share of the axis' stiffness that is lost.
    """

    KIND: ClassVar[str] = "cracked_leaf"

    loss: float = quantity(ge(0.0), lt(1.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move further, and swing more slowly.

        A further mode's peak is a share of the first, which has grown.
        """
        left = 1.0 - self.loss
        softer = detuned_axis(axis, left**0.5, left**-0.5)
        numerator = tuple(each / left for each in softer.vibration.numerator)
        modes = tuple(evolve(m, relative_peak=left * m.relative_peak) for m in softer.modes)
        vibration = RationalSpec(numerator, softer.vibration.denominator)
        return evolve(softer, vibration=vibration, modes=modes)


STOP_REACH = 10e-6  # m, pressed by which the stop would push the stage back by ``push``


@frozen(kw_only=True)
class TouchedStop(Attachment):
    """A stop that the stage touches on a part of its range: a ball on a flat (Hertz).

        x feels -push (beyond / REACH)^(3/2),    beyond = x - place, where it is above 0

    REACH is STOP_REACH. The contact grows with the indentation and becomes stiffer. The force acts
    back on the structure (attachment.py) and is conservative: a static nonlinearity on one side.
    Leapfrog method. ``place`` (m) of the stop; ``push`` (m), its force over the axis' stiffness.
    Source: K. L. Johnson, Contact Mechanics, Cambridge 1985, 4.2.
    """

    KIND: ClassVar[str] = "touched_stop"

    place: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    push: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)

    def attached(self, stage: AttachedStage) -> "Touching":
        """Stop beside the axis."""
        return Touching(self.row, stage, self.place, self.push)


@frozen(eq=False)
class Touching(Attached):
    """A stop at ``place`` (m) of ``push`` (m)."""

    place: float
    push: float

    def own_at_rest(self) -> Array:
        """A stop remembers nothing."""
        return np.zeros(0)

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the stage comes and goes."""
        stage = (self.stage.natural, self.stage.damping)
        return _push(state, path[0], step, stage, self.place, self.push / STOP_REACH**1.5)


@compiled
def _push(
    state: Array, path: Array, step: float, stage: tuple[float, float], place: float, hard: float
) -> Array:
    natural, damping = stage
    loss = damping * natural * step
    u = np.empty(path.size - 1)
    for k in range(u.size):
        pull = -hard * max(path[k] + state[0] - place, 0.0) ** 1.5 - state[0]
        state[1] = ((1.0 - loss) * state[1] + step * natural**2 * pull) / (1.0 + loss)
        state[0] += step * state[1]
        u[k] = state[0]
    return u
