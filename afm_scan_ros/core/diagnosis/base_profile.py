"""Mean square of a residual in bands, as a function of base parameters that it is linear in.

Of the parameters' deviations d from the model, in standard deviations, the prior is normal:

    s2(d) = s2 - 2 d^T l + d^T G d,    ln p = ln p(s2(d)) - d^T d / 2 - ln det(I + W G) / 2.

l and G are the mean products of the influences with the residual and with each other, and W the
weights of the bands. The last term is the volume of the posterior by Laplace's method. ln p(s2) is
convex, so that each step of the weighted least squares is to a more likely d.
"""

from collections.abc import Callable

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array

ROUNDS = 50
PRECISION = 1e-6
"""Change, in standard deviations, that ends the search."""
Weights = Callable[[Array], Array]
"""Minus twice the slope (bands,) of the log density over the mean squares (bands,)."""


@frozen(eq=False)
class Profile:
    """Most likely deviations (m,), and the mean squares (bands,) that they leave.

    ``log_base`` is the log of the prior there and of the posterior's volume over the prior's.
    """

    deviations: Array
    power: Array
    log_base: float


@frozen(eq=False)
class LinearResidual:
    """``power`` (bands,) in m², ``slope`` (bands, m) and ``gram`` (bands, m, m): s2, l and G."""

    power: Array
    slope: Array
    gram: Array

    def at(self, deviations: Array) -> Array:
        """Mean squares (bands,) that some deviations (m,) leave."""
        taken = 2.0 * self.slope @ deviations - deviations @ self.gram @ deviations
        return np.asarray(np.maximum(self.power - taken, 0.0))

    def profiled(self, weights: Weights) -> Profile:
        """Most likely deviations."""
        here: Array = np.zeros(self.slope.shape[1])
        for _ in range(ROUNDS):
            weight = weights(self.at(here))
            inner = np.eye(len(here)) + np.tensordot(weight, self.gram, 1)
            there = np.asarray(np.linalg.solve(inner, weight @ self.slope), dtype=np.float64)
            if np.all(np.abs(there - here) <= PRECISION):
                break
            here = there
        volume = -0.5 * float(np.linalg.slogdet(inner)[1])
        return Profile(there, self.at(there), volume - 0.5 * float(there @ there))
