"""Where an Everett surface's values lie, and what of them each point between is made of."""

from typing import TypeAlias

import numpy as np
from attrs import field, frozen
from attrs.validators import ge
from numpy.typing import NDArray
from scipy import sparse

from afm_scan_ros.core.types import Array

Mask: TypeAlias = NDArray[np.bool_]


@frozen
class EverettGrid:
    """``size`` equally spaced levels from ``lower`` to ``upper``, of alpha and of beta alike."""

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    size: int = field(default=51, validator=ge(2))

    @property
    def step(self) -> float:
        """Distance between levels."""
        return (self.upper - self.lower) / (self.size - 1)

    @property
    def levels(self) -> Array:
        """Levels, shape (size,)."""
        return np.linspace(self.lower, self.upper, self.size)

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
        a, b = (np.clip((x - self.lower) / self.step, 0.0, last) for x in (alpha, beta))
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
