"""Mechanisms of creep and relaxation."""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt, lt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import quantity
from afm_scan_ros.simulation.mechanisms.base import Clocked, Insert, Place

POLYMER_TAUS = np.logspace(-3, 4, 22)


@frozen(kw_only=True)
class PolymerPad(Insert):
    """A pad of polymer under the sample, which creeps by a power of time.

        x_out(t) = x(t) + share integral J(t - s) dx(s),    J(t) = (t / second)^power

    The kernel is a sum of exponentials, three to a decade, with the weights of the power's
    spectrum. ``share`` by which it creeps in a second, ``power`` of time. State: elements and x, m.
    Source: F. Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity, 2010, 2.4.
    """

    KIND: ClassVar[str] = "polymer_pad"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity(gt(0.0))
    power: float = quantity(gt(0.0), lt(1.0))

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing has crept."""
        return np.zeros(POLYMER_TAUS.size + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what has crept."""
        weights = POLYMER_TAUS**self.power
        weights *= self.share / float(weights @ -np.expm1(-1.0 / POLYMER_TAUS))
        state = state.copy()
        return state, own + _creep_polymer_pad(state, own, -np.expm1(-step / POLYMER_TAUS), weights)


@compiled
def _creep_polymer_pad(state: Array, x: Array, done: Array, weights: Array) -> Array:
    crept = np.empty_like(x)
    for k in range(x.size):
        middle = 0.5 * (state[-1] + x[k])
        state[-1] = x[k]
        crept[k] = 0.0
        for i in range(done.size):
            state[i] += done[i] * (middle - state[i])
            crept[k] += weights[i] * state[i]
    return crept


SOLDER_REACH = 10e-6  # m, of which ``settling`` is the time constant


@frozen(kw_only=True)
class SolderedJoint(Insert):
    """A joint of soft solder under the sample, which creeps by the cube of its stress.

        settling z' = (x - z) ((x - z) / REACH)^2,    x_out = x + share z

    REACH is SOLDER_REACH. The joint carries the force of the flexures, in proportion to x. The
    elastic parts beside the solder return the creep when the load goes. Number and speed of the
    dislocations both grow with the stress: creep of power three. Runge-Kutta method of fourth
    order, x linear within a step. ``share`` of the displacement by which it creeps, ``settling``
    (s) at REACH.

    State: z and the last x, m, shape (2,).
    Source: H. J. Frost, M. F. Ashby, Deformation-Mechanism Maps, Pergamon 1982, 2.4.
    """

    KIND: ClassVar[str] = "soldered_joint"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity()
    settling: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Nothing has crept."""
        return np.zeros(2)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what has crept."""
        state = state.copy()
        return state, own + self.share * _creep_soldered_joint(
            state, own, step / (self.settling * SOLDER_REACH**2)
        )


@compiled
def _creep_soldered_joint(state: Array, x: Array, pace: float) -> Array:
    z, last = state
    crept = np.empty_like(x)
    for k in range(x.size):
        total = slope = 0.0
        for ahead, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            stress = last + ahead * (x[k] - last) - (z + ahead * slope)
            slope = pace * stress**3
            total += weight / 6.0 * slope
        z, last = z + total, x[k]
        crept[k] = z
    state[:] = z, last
    return crept


DRAINING_TERMS = 40
DRAINING_ROOTS = np.pi * (np.arange(DRAINING_TERMS, dtype=np.float64) + 0.5)
DRAINING_SHARES = 2.0 / DRAINING_ROOTS**2


@frozen(kw_only=True)
class DrainingPad(Insert):
    """A pad of wet foam under the sample, which settles as its water drains.

        dp/dt = c d2p/ds2 + dx/dt,    p = 0 where it drains,    no flow at the other side
        x_out = x + share mean(x - p)

    Consolidation: the water's pressure p carries a new load, in proportion to x, until the water
    has flowed off. The pad settles with the root of time at first, as an exponential in the end,
    and recovers when the load goes. Solved by the first DRAINING_TERMS eigenfunctions, exactly for
    an x that is linear within a step. The remaining share 2 / (pi^2 DRAINING_TERMS) follows at
    once. ``share`` of x by which it settles, ``draining`` thickness^2 / c (s).

    State: the eigenfunctions and the last x, m, shape (DRAINING_TERMS + 1,).
    Source: K. Terzaghi, Theoretical Soil Mechanics, Wiley 1943, 13.
    """

    KIND: ClassVar[str] = "draining_pad"
    PLACE: ClassVar[Place] = "displacement"

    share: float = quantity()
    draining: float = quantity(gt(0.0), suffix="_s")

    def at_rest(self, step: float, rng: np.random.Generator) -> Array:  # noqa: ARG002
        """Not loaded."""
        return np.zeros(DRAINING_TERMS + 1)

    def act(self, state: Array, own: Array, other: Array, step: float) -> tuple[Array, Array]:  # noqa: ARG002
        """Displacement (m) with what has given way."""
        state = state.copy()
        given = _drain(state, own, step / self.draining * DRAINING_ROOTS**2, DRAINING_SHARES)
        return state, own + self.share * given


@compiled
def _drain(state: Array, x: Array, steps: Array, shares: Array) -> Array:
    kept = np.exp(-steps)
    lasting = (1.0 - kept) / steps
    at_once = 1.0 - shares.sum()
    given = np.empty_like(x)
    for k in range(x.size):
        total, moved = at_once * x[k], x[k] - state[-1]
        for i in range(shares.size):
            state[i] = x[k] + kept[i] * (state[i] - state[-1]) - lasting[i] * moved
            total += shares[i] * state[i]
        state[-1] = x[k]
        given[k] = total
    return given


@frozen(kw_only=True)
class RelaxingClamp(Clocked):
    """A clamp that relaxes after it was tightened, and moves the sample.

        dz/dt = scale / settling exp(-z / scale),    hence    z = scale ln(1 + t / settling)
        x_out = x + z

    Thermally activated dislocations: each step makes the next one harder, so that the speed falls
    as 1 / t. ``scale`` (m) of the logarithm, ``settling`` (s) after which it begins.
    Source: A. H. Cottrell, Dislocations and Plastic Flow in Crystals, Oxford 1953.
    """

    KIND: ClassVar[str] = "relaxing_clamp"
    PLACE: ClassVar[Place] = "displacement"

    scale: float = quantity(suffix="_nm", scale=1e-9)
    settling: float = quantity(gt(0.0), suffix="_s")

    def drawn(self, rng: np.random.Generator) -> None:
        """Nothing: it has just been tightened."""

    def at(self, time: Array, own: Array, drawn: None) -> Array:  # noqa: ARG002
        """Displacement (m) carried along by the clamp."""
        return own + self.scale * np.log1p(time / self.settling)
