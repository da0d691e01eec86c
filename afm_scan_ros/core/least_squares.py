"""Least-squares fits: that they have converged, and the intervals of what was fitted."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.optimize import OptimizeResult

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array


def require_converged(found: OptimizeResult, what: str) -> Array:
    """Return the parameters of what ``scipy.optimize.least_squares`` found.

    Raises ScanError that names ``what`` was fitted where its evaluations did not suffice.
    """
    if not found.success:
        raise ScanError(
            f"{what}: the fit has not converged after {found.nfev} evaluations: see that drive and"
            " displacement of the record belong together, or record it longer"
        )
    parameters: Array = found.x
    return parameters


Interval: TypeAlias = tuple[float, float]
"""Lower and upper end."""
NORMAL_95 = 1.959964
"""97.5th percentile of the standard normal distribution."""
STEP = 1e-6
BLIND = 1e-7
"""Relative singular value below which a slope is rounding."""


def sandwich(jacobian: Array, deviation: Array) -> Array:
    """Covariance, (p, p), of parameters that least squares fitted to independent residuals.

    ``jacobian`` is that of the residuals, (n, p), ``deviation`` their standard deviation, (n,):
    they need not all be 1, as the weights may hold more than the scatter does. What the residuals
    do not depend on, as on a pole far beyond the band, is taken for known.
    """
    sizes = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv(jacobian / sizes, rcond=BLIND) / sizes[:, np.newaxis]
    return np.asarray((inverse * deviation**2) @ inverse.T)


def slopes(function: Callable[[Array], Array], parameters: Array) -> Array:
    """Derivatives of a function's values, (n,), along the parameters, (p,): shape (n, p)."""
    steps = STEP * np.diag(np.maximum(np.abs(parameters), STEP))
    along = [(function(parameters + h) - function(parameters - h)) / (2.0 * h.sum()) for h in steps]
    return np.column_stack(along)


def intervals_95(
    figures: Callable[[Array], Array], parameters: Array, covariance: Array
) -> list[Interval]:
    """Interval of each figure of the parameters, by its slope along them."""
    along = slopes(figures, parameters)
    half = NORMAL_95 * np.sqrt(np.einsum("fp,pq,fq->f", along, covariance, along))
    return [(float(c - h), float(c + h)) for c, h in zip(figures(parameters), half, strict=True)]
