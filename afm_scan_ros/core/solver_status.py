"""Checks that a nonlinear least-squares fit has converged."""

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
