"""Mechanisms of the structure: further modes, flexures, joints and loads."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import AxisSpec, detuned_axis, quantity
from afm_scan_ros.simulation.mechanisms import attachment
from afm_scan_ros.simulation.mechanisms.base import Alteration, Insert


@frozen(kw_only=True)
class RidingMass(attachment.Attachment):
    """A small mass on a leaf spring on the stage: a second bending mode.

        m q'' + c (q' - x') + k (q - x) = 0,    the stage feels k (q - x) + c (q' - x')

    Below its own resonance the mass adds to that of the stage; far above it the stage moves alone.
    ``mass_ratio`` to the moving mass, own ``frequency`` (Hz) and ``damping`` ratio.
    """

    KIND: ClassVar[str] = "riding_mass"

    mass_ratio: float = quantity(gt(0.0))
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def attached(self, stage: attachment.AttachedStage) -> attachment.SprungBody:
        """Mass on the axis alone, its spring as stiff as mass and frequency make it."""
        natural = 2.0 * np.pi * self.frequency
        stiffness = self.mass_ratio * (natural / stage.natural) ** 2
        return attachment.SprungBody(self.row, stage, natural, self.damping, (1.0, 0.0), stiffness)


@frozen(kw_only=True)
class CoupledStage(attachment.Attachment):
    """A flexure between the two axes: the other axis pulls at this one through the flexure's mass.

        m q'' + c r' + k r = 0,  r = q - (x + y) / 2;    x feels k s + c s',  s = q - x / 2

    At low frequency the axis moves by ``share`` of the other axis' displacement. Near the flexure's
    ``frequency`` (Hz) it moves by more, and the flexure acts back on it. Assumption: the force on
    the other axis is neglected, as its actuator is much stiffer. The axis' stiffness, as stated,
    includes the flexure's. ``damping`` is a ratio.
    """

    KIND: ClassVar[str] = "coupled_stage"

    share: float = quantity()
    frequency: float = quantity(gt(0.0), suffix="_hz")
    damping: float = quantity(gt(0.0))

    def attached(self, stage: attachment.AttachedStage) -> attachment.SprungBody:
        """The coupling mode, half on either axis."""
        natural = 2.0 * np.pi * self.frequency
        halves = (0.5, 0.5)
        return attachment.SprungBody(
            self.row, stage, natural, self.damping, halves, 2.0 * self.share
        )


@frozen(eq=False)
class YieldingSprings(attachment.Parts):
    """Springs of ``share`` (1) altogether, which yield at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """Displacement u (m) while the springs are loaded and yield."""
        stage = (self.stage.natural, self.stage.damping)
        return _integrate(state, path[0], step, stage, self.share, self.reaches)


@frozen(kw_only=True)
class YieldingTube(attachment.YieldingAttachment):
    """A tube whose stiffness falls, and whose losses grow, with the deflection.

        s_i' = x' (1 - (s_i / reach_i)^2 [x' s_i > 0])
        f = -(share / n) sum_i s_i

    Springs that yield one after another as the elongation x grows (Bouc-Wen) stiffen the axis. With
    the amplitude the gain and the losses rise and the resonance falls. The springs act in feedback
    on the elongation (attachment.py). ``share`` of the axis' stiffness that the springs add,
    ``reaches`` (m) where they yield. Source: Y.-K. Wen, J. Eng. Mech. 102 (1976) 249.
    """

    KIND: ClassVar[str] = "yielding_tube"
    PARTS: ClassVar[type[attachment.Parts]] = YieldingSprings


@compiled
def _integrate(
    state: Array, path: Array, step: float, stage: tuple[float, float], share: float, reaches: Array
) -> Array:
    u = np.empty(path.size - 1)
    slope, trial, total = np.zeros(state.size), np.zeros(state.size), np.zeros(state.size)
    for k in range(u.size):
        speed = (path[k + 1] - path[k]) / step
        slope[:] = 0.0
        total[:] = state
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            for i in range(state.size):
                trial[i] = state[i] + ahead * step * slope[i]
            _slopes(trial, speed, stage, share, reaches, slope)
            for i in range(state.size):
                total[i] += step / 6.0 * weight * slope[i]
        state[:] = total
        u[k] = state[0]
    return u


@compiled
def _slopes(
    state: Array,
    speed: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
    slope: Array,
) -> None:
    natural, damping = stage
    speed += state[1]
    taut = 0.0
    for i in range(reaches.size):
        spring = state[2 + i]
        taut += spring
        yielding = (spring / reaches[i]) ** 2 if speed * spring > 0.0 else 0.0
        slope[2 + i] = speed * (1.0 - yielding)
    force = -share * taut / reaches.size
    slope[0] = state[1]
    slope[1] = natural**2 * (force - state[0]) - 2.0 * damping * natural * state[1]


@frozen(kw_only=True)
class StiffeningFlexure(Insert):
    """A flexure of beams held at both ends, which stiffens as it is stretched.

        x_out (1 + (x_out / length)^2) = x

    A deflected beam becomes longer; the tension adds a stiffness that grows with the square of the
    deflection. The cubic is solved in closed form. ``length`` (m) is the deflection at which the
    flexure is twice as stiff. There is no state.
    """

    KIND: ClassVar[str] = "stiffening_flexure"

    length: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) at which the stiffened flexure is in balance."""
        unit = 2.0 * self.length / np.sqrt(3.0)
        return None, unit * np.sinh(np.arcsinh(3.0 * own / unit) / 3.0)


@frozen(kw_only=True)
class LooseJoint(Insert):
    """A joint with play between scanner and sample.

        drag dx_out/dt = k (x - x_out - gap)    where x - x_out > gap    (one side touches)
                         k (x - x_out + gap)    where x - x_out < -gap   (the other)
                         0                      between

    The contact is a spring k, and viscous friction acts on the sample. ``contact_time`` drag / k
    (s) is the time constant of the contact. Exact for a motion that is linear within a step.
    ``gap`` (m) is the play to either side.

    State: positions of sample and scanner, m, shape (2,).
    """

    KIND: ClassVar[str] = "loose_joint"

    gap: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    contact_time: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """In the middle of the play."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        state = state.copy()
        return state, _drag(state, own, self.gap, step / self.contact_time)


@compiled
def _drag(state: Array, displacement: Array, gap: float, steps: float) -> Array:
    sample, last = state
    kept = np.exp(-steps)
    path = np.empty_like(displacement)
    for k in range(displacement.size):
        pressed = _beyond(last - sample, gap)
        unmoved = _beyond(displacement[k] - sample, gap)
        still_pressed = kept * pressed + (1.0 - kept) / steps * (unmoved - pressed)
        sample += unmoved - still_pressed
        last = displacement[k]
        path[k] = sample
    state[0], state[1] = sample, last
    return path


@compiled
def _beyond(distance: float, gap: float) -> float:
    return distance - min(max(distance, -gap), gap)


@frozen(kw_only=True)
class HeavierLoad(Alteration):
    """A heavier sample or holder on the stage: the first resonance falls.

        w' = w / sqrt(1 + ratio),   d' = d / sqrt(1 + ratio)

    Stiffness and dashpot of the mode stay. ``mass_ratio`` of the added mass to the moving mass.
    """

    KIND: ClassVar[str] = "heavier_load"

    mass_ratio: float = quantity(gt(-0.9))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Move the first resonance."""
        factor = float(1.0 / np.sqrt(1.0 + self.mass_ratio))
        return detuned_axis(axis, factor, factor)


@frozen(kw_only=True)
class ScannerBow(Insert):
    """A scanner that rotates about a point: the displacement also depends on the other axis.

        x_out = x (arm + y) / arm

    A bending tube rotates the sample. The ``arm`` (m) from the point to the sample becomes longer
    as the other axis moves out. There is no state.
    """

    KIND: ClassVar[str] = "scanner_bow"

    arm: float = quantity(ge(1e-4), suffix="_um", scale=1e-6)

    def act(self, state: None, own: Array, other: Array, step: float) -> tuple[None, Array]:  # noqa: ARG002
        """Displacement (m) at the end of the arm."""
        return None, own * (1.0 + other / self.arm)
