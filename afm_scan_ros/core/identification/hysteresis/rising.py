"""Sparse normal equations, and their solution whose differences are nowhere less than a bound."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from afm_scan_ros.core.types import Array

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
