"""Friction and hysteretic springs in feedback on the motion."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.attachment import (
    AttachedStage,
    Attachment,
    Parts,
    YieldingAttachment,
)

RINGS = 30


@inlined
def swing(state: Array, step: float, stage: tuple[float, float], share: float) -> None:
    """Move u and u' on by a step under the pull of all parts: leapfrog."""
    natural, damping = stage
    loss = damping * natural * step
    pull = -share * state[2:].mean() - state[0]
    state[1] = ((1.0 - loss) * state[1] + step * natural**2 * pull) / (1.0 + loss)
    state[0] += step * state[1]


@frozen(kw_only=True)
class PressedBalls(Attachment):
    """Balls of a worn guide that are pressed on their race, with partial slip in the contacts.

        f = -(2/3) share reach (1 - (1 - x / reach)^(3/2))    on the way up from rest

    A sphere that is pulled along a flat sticks in the middle of the contact and slips at the rim.
    The slipping ring grows inwards until all of it slides at ``reach``. After each reversal the
    slip starts anew over twice the travel (Masing). The guide is a spring that softens with the
    amplitude, with losses of the cube of a small one, in feedback on the motion (attachment.py). It
    is made of springs that slip one after another: 1 - (1 - r / reach)^(1/2) of them slip before r.
    ``share`` of the axis' stiffness that sticking balls add; ``reach`` (m) where all slide.
    Source: R. D. Mindlin, H. Deresiewicz, J. Applied Mechanics 20 (1953) 327; W. D. Iwan, ibid. 33
    (1966) 893.
    """

    KIND: ClassVar[str] = "pressed_balls"

    share: float = quantity(ge(0.0))
    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def attached(self, stage: AttachedStage) -> "SlippingRings":
        """Rings that are all equally stiff, the outermost first."""
        inner = 1.0 - (np.arange(RINGS, dtype=np.float64) + 0.5) / RINGS
        return SlippingRings(self.row, stage, self.share, self.reach * (1.0 - inner**2))


@frozen(eq=False)
class SlippingRings(Parts):
    """Rings of ``share`` (1) altogether, which slip at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the rings stick and slip."""
        stage = (self.stage.natural, self.stage.damping)
        return _rub_pressed_balls(state, path[0], step, stage, self.share, self.reaches)


@compiled
def _rub_pressed_balls(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    """A ring's bend is exact, whatever the motion within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        swing(state, step, stage, share)
        u[k] = state[0]
        moved = path[k + 1] - path[k] + step * state[1]
        for i in range(reaches.size):
            state[2 + i] = min(max(state[2 + i] + moved, -reaches[i]), reaches[i])
    return u


@frozen(eq=False)
class Bristles(Parts):
    """Bristles of ``share`` (1) altogether, which slip at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the bristles bend and slip."""
        stage = (self.stage.natural, self.stage.damping)
        return _rub_rubbing_guide(state, path[0], step, stage, self.share, self.reaches)


@frozen(kw_only=True)
class RubbingGuide(YieldingAttachment):
    """A guide with Dahl friction on the stage, in feedback on the motion.

        f' = stiffness x' (1 - (f / friction) sgn x')

    Bristles deflect with the motion until they slip: a spring for small motions, a constant force
    for large ones. Several guides have a reach friction / stiffness each. ``share`` of the axis'
    stiffness that the bristles add, ``reaches`` (m) where they slip.
    Source: P. R. Dahl, AIAA J. 14 (1976) 1675.
    """

    KIND: ClassVar[str] = "rubbing_guide"
    PARTS: ClassVar[type[Parts]] = Bristles


@compiled
def _rub_rubbing_guide(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    """A bristle's bend is exact for a motion that is straight within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        swing(state, step, stage, share)
        u[k] = state[0]
        moved = path[k + 1] - path[k] + step * state[1]
        for i in range(reaches.size):
            end = np.sign(moved) * reaches[i]
            state[2 + i] = end + (state[2 + i] - end) * np.exp(-abs(moved) / reaches[i])
    return u


STRIBECK_SPEED = 2e-3  # m/s, at which the grease begins to carry


@frozen(kw_only=True)
class StribeckGuide(YieldingAttachment):
    """A greased guide with Stribeck friction (LuGre), in feedback on the motion.

        f' = stiffness (x' - |x'| f / g(x')),    g = friction (1 + stiction exp(-(x' / SPEED)^2))

    SPEED is STRIBECK_SPEED. At rest the friction is (1 + stiction) times that at speed, so that a
    slow scan loses more in each turn than a fast one. Several guides have a reach friction /
    stiffness each. The bristles' own damping is left out. ``share`` of the axis' stiffness that the
    bristles add, ``reaches`` (m) where they slip at speed, ``stiction`` (1).
    Source: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control
    40 (1995) 419.
    """

    KIND: ClassVar[str] = "stribeck_guide"

    stiction: float = quantity(ge(0.0))

    def attached(self, stage: AttachedStage) -> "GreasedBristles":
        """Bristles that are all equally stiff."""
        return GreasedBristles(self.row, stage, self.share, np.array(self.reaches), self.stiction)


@frozen(eq=False)
class GreasedBristles(Parts):
    """Bristles of ``share`` (1) altogether, which slip at ``reaches`` (m) and later at rest."""

    stiction: float

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the bristles bend and slip."""
        stage = (self.stage.natural, self.stage.damping)
        return _rub_stribeck_guide(
            state, path[0], step, stage, self.share, self.reaches, self.stiction
        )


@compiled
def _rub_stribeck_guide(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
    stiction: float,
) -> Array:
    """A bristle's bend is exact for a motion that is straight within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        swing(state, step, stage, share)
        u[k] = state[0]
        moved = path[k + 1] - path[k] + step * state[1]
        held = 1.0 + stiction * np.exp(-((moved / (STRIBECK_SPEED * step)) ** 2))
        for i in range(reaches.size):
            reach = held * reaches[i]
            end = np.sign(moved) * reach
            state[2 + i] = end + (state[2 + i] - end) * np.exp(-abs(moved) / reach)
    return u


RETURN_STRESS = 0.5  # stress at which the alloy turns back, over that at which it turns


@frozen(eq=False)
class TurningLeaves(Parts):
    """Leaves of ``share`` (1) altogether, which begin to turn at ``reaches`` (m)."""

    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) while the leaves bend and turn."""
        stage = (self.stage.natural, self.stage.damping)
        return _bend(state, path[0], step, stage, self.share, self.reaches)


@frozen(kw_only=True)
class SuperelasticLeaf(YieldingAttachment):
    """Leaves of a superelastic alloy beside the flexures.

        p_i = share (x - z_i) / n,    0 <= x - z_i <= reach_i while z_i grows,
        z_i falls only where x - z_i <= RETURN reach_i,  and not below 0;  mirrored where x < 0
        f = -sum p_i

    RETURN is RETURN_STRESS. The alloy transforms at one stress under load and transforms back at a
    lower one: a flag-shaped loop. Small motions are elastic; large ones meet less stiffness and a
    loss, and nothing remains at rest. The leaves act in feedback on the elongation (attachment.py).
    ``share`` of the axis' stiffness that the leaves add, ``reaches`` (m) where they begin to
    transform.
    Source: F. Auricchio, R. L. Taylor, J. Lubliner, Computer Methods in Applied Mechanics and
    Engineering 146 (1997) 281.
    """

    KIND: ClassVar[str] = "superelastic_leaf"
    PARTS: ClassVar[type[Parts]] = TurningLeaves


@compiled
def _bend(
    state: Array,
    path: Array,
    step: float,
    stage: tuple[float, float],
    share: float,
    reaches: Array,
) -> Array:
    """A leaf's bend is exact, whatever the motion within a step."""
    u = np.empty(path.size - 1)
    for k in range(u.size):
        before = path[k] + state[0]
        swing(state, step, stage, share)
        u[k] = state[0]
        x = path[k + 1] + state[0]
        for i in range(reaches.size):
            state[2 + i] = x - _turned(x, before - state[2 + i], reaches[i])
    return u


@inlined
def _turned(x: float, turned: float, reach: float) -> float:
    """Z (m) at x where it was ``turned``."""
    side = np.sign(x)
    out = min(max(side * turned, side * x - reach), side * x - RETURN_STRESS * reach)
    return float(side * max(out, 0.0))
