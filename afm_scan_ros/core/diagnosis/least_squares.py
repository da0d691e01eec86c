"""Nonlinear least squares within bounds, by the method of Levenberg and Marquardt.

A residual has far more values than parameters, so that steps are taken from the normal equations of
the scaled columns of its Jacobian.
Source: K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems, DTU
2004, algorithm 3.16.
"""

from collections.abc import Callable

import numpy as np
from attrs import frozen
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from afm_scan_ros.core.diagnosis.settings import DESCENT, DescentSettings
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Equations:
    """Normal equations of a residual (n,) about some values (f,) that have bounds.

    ``matrix`` (f, f) and ``right`` (f,) are of columns scaled to ``size`` (f,); ``lowest`` and
    ``highest`` (f,) bound the moves of scaled values.
    """

    matrix: Array
    right: Array
    size: Array
    lowest: Array
    highest: Array

    @classmethod
    def of(cls, slope: Array, left: Array, lowest: Array, highest: Array) -> "Equations":
        """Of a Jacobian (n, f), a residual (n,) and bounds (f,) of the move.

        Raises ScanError where a derivative is not finite.
        """
        size = np.linalg.norm(slope, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        matrix = slope.T @ slope / np.outer(size, size)
        if not np.isfinite(matrix).all():
            raise ScanError("the fit diverged: a response grows without bound")
        return cls(matrix, -(left @ slope) / size, size, lowest * size, highest * size)

    def move(self, damping: float) -> Array:
        """Move (f,) within the bounds that lowers the damped equations most, of scaled values."""
        root = cholesky(self.matrix + damping * np.eye(len(self.right)))
        aim = solve_triangular(root, self.right, trans="T")
        move = solve_triangular(root, aim)
        if np.all((self.lowest <= move) & (move <= self.highest)):
            return np.asarray(move)
        ends = self.lowest, np.maximum(self.highest, np.nextafter(self.lowest, np.inf))
        found = lsq_linear(root, aim, ends, method="bvls").x
        return np.asarray(np.clip(found, self.lowest, self.highest))

    def gain(self, move: Array) -> float:
        """By how much a move lowers half the residual's squares, were the residual linear."""
        return float(move @ self.right - 0.5 * move @ self.matrix @ move)


def minimised(
    residual: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: Array,
    bounds: tuple[Array, Array],
    settings: DescentSettings = DESCENT,
) -> tuple[Array, Array]:
    """Return values (f,) that a residual's sum of squares is least at, and the Jacobian (n, f).

    They are found after the most rounds, or where no step lowers half that sum by more than the
    tolerance.
    """
    values, damping, worse = start, settings.first_damping, 2.0
    left, slope = residual(values), jacobian(values)
    for _ in range(settings.rounds):
        equations = Equations.of(slope, left, bounds[0] - values, bounds[1] - values)
        if equations.gain(equations.move(settings.least_damping)) < settings.tolerance:
            break
        move = equations.move(damping)
        foreseen, tried = equations.gain(move), np.clip(values + move / equations.size, *bounds)
        there = residual(tried)
        fell = 0.5 * float(left @ left - there @ there)
        if fell > 0.0:
            better = max(1.0 / 3.0, 1.0 - (2.0 * fell / foreseen - 1.0) ** 3)
            damping, worse = max(better * damping, settings.least_damping), 2.0
            values, left, slope = tried, there, jacobian(tried)
        elif foreseen < settings.tolerance:
            break
        else:
            damping, worse = worse * damping, 2.0 * worse
    return values, slope
