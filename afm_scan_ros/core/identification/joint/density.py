"""Weights of the Preisach plane's cells, by regularised non-negative least squares."""

from typing import TypeAlias

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import nnls

from afm_scan_ros.core.identification.joint.cells import cell_count, side
from afm_scan_ros.core.types import Array

Indices: TypeAlias = NDArray[np.int64]

REVERSIBLE = 0.01
"""Least weight of all cells on the diagonal, in rms displacements: it gives an inverse."""
ROUNDING = 1e-12
"""Share of the equations' trace that keeps them positive definite where nothing was swept."""


@frozen(eq=False)
class NormalEquations:
    """Equations of the weights from a stretch of record; those of two stretches add up.

    ``gram`` AᵀA (p, p), ``moment`` Aᵀy (p,) in m, ``energy`` yᵀy in m².
    """

    gram: Array
    moment: Array
    energy: float
    samples: float

    @classmethod
    def of(cls, areas: Array, displacement: Array, samples: float) -> "NormalEquations":
        """Take areas A (n, p) and the displacement y (n,), m, whose squares count ``samples``."""
        energy = float(displacement @ displacement)
        return cls(areas.T @ areas, areas.T @ displacement, energy, samples)

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        return NormalEquations(
            self.gram + other.gram,
            self.moment + other.moment,
            self.energy + other.energy,
            self.samples + other.samples,
        )

    def rms(self, weights: Array) -> float:
        """Root of the mean square, m, that these weights leave."""
        return float(np.sqrt(self.squares(weights) / self.samples))

    def squares(self, weights: Array) -> float:
        """Sum of the squares, m², that these weights leave."""
        return float(self.energy + weights @ (self.gram @ weights - 2.0 * self.moment))


def solve(equations: NormalEquations, smoothing: float) -> Array:
    """Weights (m), shape (p,), none negative.

    Least is the mean square misfit plus ``smoothing`` times the mean square slope of the density,
    over alpha and beta from 0 to 1; so one smoothing serves every size of the grid.
    """
    cells = side(len(equations.moment))
    least = np.zeros_like(equations.moment)
    least[diagonal(cells)] = REVERSIBLE * np.sqrt(equations.energy / equations.samples) / cells
    matrix = equations.gram / equations.samples + smoothing * roughness(cells)
    matrix += ROUNDING * np.trace(matrix) * np.eye(len(matrix))
    root = cholesky(matrix, lower=True)
    moment = equations.moment / equations.samples - matrix @ least
    above = nnls(root.T, solve_triangular(root, moment, lower=True), maxiter=20 * len(root))[0]
    return np.asarray(least + above)


def roughness(cells: int) -> Array:
    """Quadratic form of the density's differences between neighbours, shape (p, p).

    The diagonal, where thresholds are equal, has a density of its own, along a line.
    """
    count = cell_count(cells)
    index = np.zeros((cells, cells), dtype=np.int64)
    index[np.tril_indices(cells)] = np.arange(count)
    below = np.tri(cells, k=-1, dtype=bool)
    along_alpha = index[:-1][below[:-1]], index[1:][below[:-1]]
    along_beta = index[:, :-1][below[:, 1:]], index[:, 1:][below[:, 1:]]
    on_diagonal = diagonal(cells)[:-1], diagonal(cells)[1:]
    return cells**4 * (
        _differences(count, *along_alpha) + _differences(count, *along_beta)
    ) + cells**3 * _differences(count, *on_diagonal)


def _differences(count: int, first: Indices, second: Indices) -> Array:
    """Quadratic form Σ (w[second] - w[first])²."""
    steps = np.zeros((len(first), count))
    steps[np.arange(len(first)), first] = -1.0
    steps[np.arange(len(first)), second] = 1.0
    return steps.T @ steps


def diagonal(cells: int) -> Indices:
    """Numbers of the cells, (cells,), whose relays have two thresholds that are one."""
    numbers = np.arange(1, cells + 1)
    return numbers * (numbers + 1) // 2 - 1
