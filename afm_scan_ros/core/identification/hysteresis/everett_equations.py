"""Where an Everett surface's values lie, and what of them each point between is made of.

Points of first-order reversal curves → linear equations in the Everett surface's values.

Every output on a curve is the saturation's plus and minus twice some values of E (Eq. 17). With
input x, and a curve that turns at t,

    falling:  F = F_lower + 2 E(t, lower) - 2 E(t, x)
    rising:   F = F_lower + 2 E(upper, lower) - 2 E(upper, t) + 2 E(x, t)

so that the surface follows by least squares, without differentiation. Where minor loops are not
congruent, both families together give the surface that is right on average.

Sparse normal equations, and their solution whose differences are nowhere less than a bound.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from attrs import field, frozen
from attrs.validators import ge
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurve
from afm_scan_ros.core.types import Array, by_value

Mask: TypeAlias = NDArray[np.bool_]

NEAR = 1e-3
"""Share of the range within which turns are one."""
OUTERMOST = 2
"""Distances of turns that determine how dense levels are beyond the last one."""


def _reaching_end(levels: Array) -> Array:
    """Fill the last distance of ascending levels as densely as those before it lie."""
    gaps = np.diff(levels)
    if len(gaps) < OUTERMOST + 1:
        return levels
    more = round(float(gaps[-1] / np.median(gaps[-1 - OUTERMOST : -1])))
    return np.append(levels[:-2], np.linspace(levels[-2], levels[-1], max(more, 1) + 1))


@frozen
class EverettGrid:
    """``size`` levels from ``lower`` to ``upper``, of alpha and of beta alike.

    They are evenly spaced, or those of ``uneven``, shape (size,).
    """

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    size: int = field(default=51, validator=ge(2))
    uneven: Array | None = field(default=None, eq=by_value)

    @property
    def levels(self) -> Array:
        """Levels, shape (size,)."""
        if self.uneven is not None:
            return self.uneven
        return np.linspace(self.lower, self.upper, self.size)

    @property
    def finer(self) -> "EverettGrid":
        """The grid with a level more in the middle of each cell."""
        size = 2 * self.size - 1
        between = None if self.uneven is None else self.level(np.arange(size) / 2.0)
        return EverettGrid(self.lower, self.upper, size, between)

    @classmethod
    def by_turns(cls, turns: Array, lower: float, upper: float, size: int) -> "EverettGrid":
        """Lay levels as densely as curves turn: equal information between all levels.

        ``turns`` (m,) are inputs; those nearer than NEAR of the range are one. Levels go on as the
        outermost lie, to an end that no turn is near: where one family is missing, curves pass.
        """
        known = np.sort(np.concatenate([turns, [lower, upper]]))
        apart = np.diff(known, prepend=-np.inf) > NEAR * (upper - lower)
        known = np.append(known[apart & (known < upper - NEAR * (upper - lower))], upper)
        known[0] = lower
        known = -_reaching_end(-_reaching_end(known)[::-1])[::-1]
        if np.ptp(np.diff(known)) <= NEAR * (upper - lower):
            return cls(lower, upper, size)
        places = np.linspace(0.0, len(known) - 1.0, size)
        return cls(lower, upper, size, np.interp(places, np.arange(len(known)), known))

    def stretched(self, lower: float, upper: float) -> "EverettGrid":
        """Return the grid over other limits, the levels in the same proportions."""
        uneven = self.uneven
        if uneven is not None:
            uneven = np.interp(uneven, [self.lower, self.upper], [lower, upper])
        return EverettGrid(lower, upper, self.size, uneven)

    def place(self, inputs: Array) -> Array:
        """Inputs (n,) in cells from ``lower``; those beyond the grid count as on its edge."""
        return np.interp(inputs, self.levels, np.arange(self.size))

    def level(self, places: Array) -> Array:
        """Inputs (n,) at places in cells from ``lower``."""
        return np.interp(places, np.arange(self.size), self.levels)

    @property
    def inside(self) -> Mask:
        """Where alpha > beta, so that E is neither zero nor meaningless, shape (size, size)."""
        return np.tri(self.size, k=-1, dtype=np.bool_)

    def weights(self, alpha: Array, beta: Array) -> sparse.csr_matrix:
        """Weights of the values in E(alpha, beta), for points (n,), shape (n, size * size).

        Bilinear, and linear in the triangles along the diagonal, as EverettSurface is read.
        Points beyond the grid count as on its edge.
        """
        last = self.size - 1
        a, b = self.place(alpha), self.place(beta)
        i, j = (np.minimum(x.astype(np.int64), last - 1) for x in (a, b))
        p, q = a - i, b - j
        corners = np.stack([(1.0 - p) * (1.0 - q), p * (1.0 - q), (1.0 - p) * q, p * q])
        beside = i == j
        corners[:, beside] = 0.0
        corners[1, beside] = (a - b)[beside]
        nodes = np.stack([(i + k) * self.size + j + m for m in (0, 1) for k in (0, 1)])
        rows = np.tile(np.arange(len(a)), 4)
        shape = (len(a), self.size**2)
        matrix = sparse.csr_matrix((corners.ravel(), (rows, nodes.ravel())), shape=shape)
        matrix.eliminate_zeros()
        return matrix


@frozen(eq=False)
class SurfaceEquations:
    """``matrix`` @ (values of E row by row, F at negative saturation) = ``outputs``, (n,)."""

    matrix: sparse.csr_matrix
    outputs: Array


def equations(curves: Sequence[ReversalCurve], grid: EverettGrid) -> SurfaceEquations:
    """One equation for each point of each curve."""
    matrix = sparse.vstack([_curve(curve, grid) for curve in curves], format="csr")
    return SurfaceEquations(matrix, np.concatenate([curve.outputs for curve in curves]))


def _curve(curve: ReversalCurve, grid: EverettGrid) -> sparse.csr_matrix:
    x = curve.inputs
    turn, lower, upper = (np.full_like(x, at) for at in (curve.turn, grid.lower, grid.upper))
    if curve.rises:
        rise = grid.weights(upper, lower) - grid.weights(upper, turn)
        values = rise + grid.weights(np.maximum(x, turn), turn)
    else:
        values = grid.weights(turn, lower) - grid.weights(turn, np.minimum(x, turn))
    return sparse.hstack([2.0 * values, np.ones((len(x), 1))], format="csr")


HEAVY = 1e3
"""Weight of a difference that is held, over the largest on the equations' diagonal."""
ENOUGH = 0.5
"""Share of the bound that counts as kept, as what is held lies just below it."""
ROUNDS = 50


def solved(normal: sparse.csc_matrix, given: Array) -> Array:
    """Solve positive definite equations ``normal`` (n, n) for ``given`` (n,).

    They are factorised on the diagonal, in an order that keeps the factors sparse: ten times
    faster.
    """
    options = {"SymmetricMode": True}
    factors = splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    solution: Array = factors.solve(given)
    return solution


def solved_rising(
    normal: sparse.csc_matrix, free: Array, differences: sparse.csr_matrix, least: float
) -> Array:
    """Solve what ``free`` (n,) solves, under ``differences`` (m, n) x ≥ ``least`` > 0.

    Differences that are less are held at the bound by a penalty and a multiplier each, and let go
    once the rest pulls them above it, until none is too small (the augmented Lagrangian; J. Nocedal
    and S. J. Wright, Numerical Optimization, 2006, section 17.3). Where ROUNDS do not suffice, some
    are left.
    """
    solution, given, heavy = free, normal @ free, HEAVY * normal.diagonal().max()
    multipliers = np.zeros(differences.shape[0])
    for _ in range(ROUNDS):
        short = least - differences @ solution
        if np.all(short <= (1.0 - ENOUGH) * least):
            break
        held = multipliers + heavy * short > 0.0
        rows = differences[held]
        pull = rows.T @ (multipliers[held] + heavy * least)
        solution = solved((normal + heavy * (rows.T @ rows)).tocsc(), given + pull)
        pulled = multipliers + heavy * (least - differences @ solution)
        multipliers = np.where(held, np.maximum(pulled, 0.0), 0.0)
    return solution
