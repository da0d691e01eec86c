"""How smooth the slopes of a Duhem operator are, by the evidence of a record.

Third differences of the splines' coefficients are a priori normal, of one variance. Its ratio to
the noise's is that of most evidence (restricted maximum likelihood). Two branches of one kind never
move apart, as no loop would settle then: slopes do not grow along w where they rise, and do not
fall where they fall. So is the extrapolation to where no branch came.
Source: P. H. C. Eilers and B. D. Marx, Statistical Science 11 (1996) 89; S. N. Wood, J. Royal
Statistical Society B 73 (2011) 3, Eq. 4; C. L. Lawson and R. J. Hanson, Solving Least Squares
Problems, 1974, chapter 23.
"""

import numpy as np
from attrs import frozen
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize_scalar, nnls

from afm_scan_ros.core.types import Array

ORDER = 3
"""Order of the differences that are a priori small: Duhem's own equation is linear in F."""
WEAKEST, STRONGEST = -12.0, 2.0
"""Exponents of ten of the prior's strength, over the data's, between which evidence decides."""


@frozen(eq=False)
class Evidence:
    """Normal equations of the data, of (rising, falling) slopes, and of the prior.

    At a strength of 1 both weigh alike. ``square`` is the sum of the squared data of so many
    ``points``, ``rank`` that of the prior, ``shape`` that of both tables.
    """

    data: Array
    prior: Array
    given: Array
    square: float
    points: int
    rank: int
    shape: tuple[int, ...]

    @classmethod
    def of(cls, matrix: Array, given: Array, shape: tuple[int, ...]) -> "Evidence":
        """Take equations for slopes of such a ``shape``, (n, slopes) and (n,)."""
        _, rows, columns = shape
        rough, data = np.kron(np.eye(2), _roughness(rows, columns)), matrix.T @ matrix
        prior = np.asarray(rough * (np.trace(data) / np.trace(rough)))
        rank = 2 * (rows * columns - ORDER**2)
        return cls(data, prior, matrix.T @ given, float(given @ given), len(given), rank, shape)

    def best(self) -> float:
        """Strength of most evidence."""
        found = minimize_scalar(
            self._lacking, bounds=(WEAKEST, STRONGEST), method="bounded", options={"xatol": 0.1}
        )
        return float(10.0**found.x)

    def _lacking(self, exponent: float) -> float:
        """Minus twice the logarithm of the evidence, but for a constant."""
        factor = cho_factor(self.data + 10.0**exponent * self.prior, lower=True)
        residual = self.square - self.given @ cho_solve(factor, self.given)
        free = self.points - (len(self.given) - self.rank)
        volume = 2.0 * np.log(np.diag(factor[0])).sum()
        return float(free * np.log(residual) + volume - self.rank * np.log(10.0) * exponent)

    def solved(self, strength: float, least: float) -> Array:
        """Most probable slopes of at least ``least``, whose branches never move apart."""
        normal = self.data + strength * self.prior
        sums = _sums_across(self.shape)
        factor = np.linalg.cholesky(sums.T @ normal @ sums)
        given = sums.T @ (self.given - normal @ np.full(len(normal), least))
        rises, _ = nnls(factor.T, solve_triangular(factor, given, lower=True))
        return np.asarray((least + sums @ rises).reshape(self.shape))


def _sums_across(shape: tuple[int, ...]) -> Array:
    """Slopes above the least from their rises, which go down on rising branches, else up."""
    _, rows, columns = shape
    falling = np.tri(columns)
    return np.asarray(block_diag(*[falling.T] * rows, *[falling] * rows))


def _roughness(rows: int, columns: int) -> Array:
    """Sum of squared third differences along either side of a table, per extent of that side."""

    def along(size: int, other: int) -> Array:
        third = np.diff(np.eye(size), n=ORDER, axis=0)
        return np.asarray(third.T @ third * float(size - 3) ** (2 * ORDER - 1) / (other - 3))

    each = np.kron(along(rows, columns), np.eye(columns))
    return np.asarray(each + np.kron(np.eye(rows), along(columns, rows)))
