"""Points of first-order reversal curves → linear equations in the Everett surface's values.

Every output on a curve is the saturation's plus and minus twice some values of E (Eq. 17). With
input x, and a curve that turns at t,

    falling:  F = F_lower + 2 E(t, lower) - 2 E(t, x)
    rising:   F = F_lower + 2 E(upper, lower) - 2 E(upper, t) + 2 E(x, t)

so that the surface follows by least squares, without differentiation. Where minor loops are not
congruent, both families together give the surface that is right on average.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from scipy import sparse

from afm_scan_ros.core.identification.hysteresis.everett_grid import EverettGrid
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurve
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Equations:
    """``matrix`` @ (values of E row by row, F at negative saturation) = ``outputs``, (n,)."""

    matrix: sparse.csr_matrix
    outputs: Array


def equations(curves: Sequence[ReversalCurve], grid: EverettGrid) -> Equations:
    """One equation for each point of each curve."""
    matrix = sparse.vstack([_curve(curve, grid) for curve in curves], format="csr")
    return Equations(matrix, np.concatenate([curve.outputs for curve in curves]))


def _curve(curve: ReversalCurve, grid: EverettGrid) -> sparse.csr_matrix:
    x = curve.inputs
    turn, lower, upper = (np.full_like(x, at) for at in (curve.turn, grid.lower, grid.upper))
    if curve.rises:
        rise = grid.weights(upper, lower) - grid.weights(upper, turn)
        values = rise + grid.weights(np.maximum(x, turn), turn)
    else:
        values = grid.weights(turn, lower) - grid.weights(turn, np.minimum(x, turn))
    return sparse.hstack([2.0 * values, np.ones((len(x), 1))], format="csr")
