"""Joints with play, loose samples and bistable parts."""

from math import hypot, sqrt
from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import ge, gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Insert, Place

OIL_FILM = 0.01


@frozen(kw_only=True)
class FloodedJoint(Insert):
    """A joint with play that is filled with oil: squeeze films in place of contacts.

        film (x' - x_out') / p^3 = drag x_out',    p = 1 -+ (x - x_out) / gap

    p is the thickness of the squeezed film over the gap; the other film cavitates. The force of a
    film goes as the inverse cube of its thickness (Reynolds), that of the sample's slide is
    viscous. Both are proportional to speed, so that the speed cancels. film / drag = OIL_FILM. The
    sample hardly moves within the play and never touches its ends: backlash of nearly twice the gap
    at each reversal. Along a motion p - OIL_FILM / (2 p^2) falls by the travel over the gap; solved
    by Newton's method. ``gap`` (m) to either side. State: positions of sample and scanner, m, shape
    (2,).
    Source: B. J. Hamrock, Fundamentals of Fluid Film Lubrication, 1994 (squeeze films).
    """

    KIND: ClassVar[str] = "flooded_joint"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(gt(0.0), suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """In the middle of the play."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        state = state.copy()
        return state, _drag_flooded_joint(state, own, self.gap, OIL_FILM)


@compiled
def _drag_flooded_joint(state: Array, x: Array, gap: float, film: float) -> Array:
    sample, last = state
    path = np.empty_like(x)
    for k in range(x.size):
        side = np.sign(x[k] - last)
        if side != 0.0:
            thickness = 1.0 - side * (last - sample) / gap
            left = thickness - 0.5 * film / thickness**2 - abs(x[k] - last) / gap
            sample = x[k] - side * gap * (1.0 - _squeezed(left, film))
        last = x[k]
        path[k] = sample
    state[:] = sample, last
    return path


@compiled
def _squeezed(left: float, film: float) -> float:
    """Return p of p - film / (2 p^2) = ``left``, which is 2 at most; Newton climbs to it."""
    p, before = max(left, sqrt(0.5 * film / (2.0 - left))), 0.0
    while p - before > 1e-15 * p:
        before = p
        p += (left - p + 0.5 * film / p**2) / (1.0 + film / p**3)
    return p


@frozen(kw_only=True)
class RoundHole(Insert):
    """A pin of the scanner in a wider round hole of the sample's holder: play in a plane.

        d = (x, y) - (x_out, y_out),    |d| <= gap,    and where |d| = gap the holder moves along d

    Friction holds the holder until the pin touches the wall and drags it. At each reversal the pin
    crosses the hole along a chord, which depends on the other axis. The other axis is read at the
    pin. Exact for a pin that moves linearly within a step: in contact the holder follows a
    tractrix, and the tangent of half its angle to the path falls by e in each gap of travel.
    ``gap`` (m) by which the radius of the hole exceeds that of the pin.

    State: holder along the axis and across, and the pin likewise, m, shape (4,).
    Source: J. J. Moreau, J. Differential Equations 26 (1977) 347 (sweeping process).
    """

    KIND: ClassVar[str] = "round_hole"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(gt(0.0), suffix="_nm", scale=1e-9)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """The pin in the middle of the hole."""
        return np.zeros(4)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the holder."""
        state = state.copy()
        return state, _drag_round_hole(state, own, other, self.gap)


@compiled
def _drag_round_hole(state: Array, x: Array, y: Array, gap: float) -> Array:
    path = np.empty_like(x)
    for k in range(x.size):
        way = hypot(x[k] - state[2], y[k] - state[3])
        if way > 0.0:
            ahead = (x[k] - state[2]) / way, (y[k] - state[3]) / way
            along = (state[2] - state[0]) * ahead[0] + (state[3] - state[1]) * ahead[1]
            aside = (state[3] - state[1]) * ahead[0] - (state[2] - state[0]) * ahead[1]
            wall = np.sqrt(max(gap**2 - aside**2, 0.0))
            dragged = way - (wall - along)
            if dragged > 0.0:
                half = aside / (gap + wall) * np.exp(-dragged / gap)
                along = gap * (1.0 - half**2) / (1.0 + half**2)
                aside = gap * 2.0 * half / (1.0 + half**2)
                state[0] = x[k] - along * ahead[0] + aside * ahead[1]
                state[1] = y[k] - along * ahead[1] - aside * ahead[0]
            state[2], state[3] = x[k], y[k]
        path[k] = state[0]
    return path


@frozen(kw_only=True)
class SpringyJoint(Insert):
    """A joint with play and a return spring across it: the play hides a part of the motion only.

        x_out = (1 - share) p + share x,    p <- min(max(p, x - gap), x + gap)

    ``gap`` (m) to either side, ``share`` that passes within it. State: p, m.
    """

    KIND: ClassVar[str] = "springy_joint"
    PLACE: ClassVar[Place] = "displacement"

    gap: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    share: float = quantity(ge(0.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> float:  # noqa: ARG002
        """In the middle of the play."""
        return 0.0

    def act(self, state: float, own: Array, other: Array, step: float) -> tuple[float, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        dragged = _drag_springy_joint(state, own, self.gap)
        return float(dragged[-1]), (1.0 - self.share) * dragged + self.share * own


@compiled
def _drag_springy_joint(place: float, x: Array, gap: float) -> Array:
    path = np.empty_like(x)
    for k in range(x.size):
        place = min(max(place, x[k] - gap), x[k] + gap)
        path[k] = place
    return path


@frozen(kw_only=True)
class SlidingSample(Insert):
    """A loose sample in a recess that slides where the scanner's acceleration exceeds friction.

        sticks:  w = 0                       while |x''| <= grip
        slides:  w' = -x'' - grip sgn(w)     until w = 0 and |x''| <= grip
        x_out = x + integral of w, between the walls of the recess, where it stops

    w is its speed on the scanner, ``grip`` (m/s^2) Coulomb's coefficient times gravity. It slides
    at the turns of a fast scan, and not in a slow one. Leapfrog method, friction and walls as
    impulses (Moreau's scheme). ``room`` (m) to either wall.

    State: sliding distance (m), w (m/s), the last x (m) and x' (m/s), shape (4,).
    Source: J. J. Moreau, in Nonsmooth Mechanics and Applications, Springer 1988, 1.
    """

    KIND: ClassVar[str] = "sliding_sample"
    PLACE: ClassVar[Place] = "displacement"

    grip: float = quantity(gt(0.0), suffix="_m_per_s2")
    room: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """It lies in its place."""
        return np.zeros(4)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) of the sample."""
        state = state.copy()
        return state, own + _slide(state, own, step, self.grip * step, self.room)


@compiled
def _slide(state: Array, x: Array, step: float, impulse: float, room: float) -> Array:
    slid, sliding, last, speed = state
    path = np.empty_like(x)
    for k in range(x.size):
        pace = (x[k] - last) / step
        free = sliding - (pace - speed)
        sliding = free - min(max(free, -impulse), impulse)
        slid += step * sliding
        if abs(slid) > room:
            slid, sliding = np.sign(slid) * room, 0.0
        path[k] = slid
        last, speed = x[k], pace
    state[:] = slid, sliding, last, speed
    return path


SNAP_TIME = 0.3e-3  # s


@frozen(kw_only=True)
class SnappingLeaf(Insert):
    """A buckled leaf spring between stage and frame, which snaps through as the stage moves.

        SNAP_TIME w' = w - w^3 + x / reach,    x_out = x + throw (w + 1)

    The leaf has two stable positions. It snaps from one to the other within milliseconds, at 0.385
    ``reach`` on the way up and at the opposite place on the way down. No motion is lost between the
    jumps: no catalogued effect describes it. Runge-Kutta method of fourth order, x linear within a
    step. ``throw`` (m) of a stable position, ``reach`` (m). State: w and the last x (m), shape
    (2,).
    Source: S. H. Strogatz, Nonlinear Dynamics and Chaos, 1994, 3.6 (imperfect bifurcations).
    """

    KIND: ClassVar[str] = "snapping_leaf"
    PLACE: ClassVar[Place] = "displacement"

    throw: float = quantity(suffix="_nm", scale=1e-9)
    reach: float = quantity(gt(0.0), suffix="_um", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Buckled downwards."""
        return np.array([-1.0, 0.0])

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what the leaf adds to it."""
        state = state.copy()
        return state, own + self.throw * _snap(
            state, own / self.reach, step / SNAP_TIME, self.reach
        )


@compiled
def _snap(state: Array, pull: Array, steps: float, reach: float) -> Array:
    w, last = state[0], state[1] / reach
    path = np.empty_like(pull)
    for k in range(pull.size):
        total = slope = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            trial = w + ahead * slope
            slope = steps * (trial - trial**3 + last + ahead * (pull[k] - last))
            total += weight / 6.0 * slope
        w, last = w + total, pull[k]
        path[k] = w + 1.0
    state[:] = w, last * reach
    return path
