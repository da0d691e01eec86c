"""How well a fit knows its parameters.

Near the most probable θ the posterior is normal, with the covariance (H + Λ)⁻¹ of the normal
equations' H and the prior's precision Λ. What no record tells keeps the prior's width.
"""

from collections.abc import Iterable

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.signal import welch

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.signals import correlation_length
from afm_scan_ros.core.types import Array


def of_records(fit: AxisFit) -> list[Array]:
    """H of each record, its blocks being independent and varying by v_k."""
    found = []
    for k, left in enumerate(fit.gathered()):
        found.append(fit.products(k, left, fit.columns(k, with_operator=True))[0])
    return found


def information(fit: AxisFit, every: Iterable[Array]) -> Array:
    """H of the normal equations, of the H of ``every`` record.

    A record varies by what the fit leaves of it, or by its noise at least, and samples whose
    residuals are alike are as one.
    """
    matrix = np.zeros((fit.layout.size,) * 2)
    for record, left, each in zip(fit.records, fit.residuals(), every, strict=True):
        alike = samples_alike(left, fit.layout.settings.residual_segments)
        own = max(float(np.mean(left**2)), record.noise**2 / record.block)
        matrix += fit.variance(record) / (own * alike) * each
    return matrix


def samples_alike(left: Array, segments: int) -> float:
    """Samples of a residual (n,) that tell as much as one independent sample.

    That is its spectral density over the mean density, where a parameter is told: that of the
    slowest parameters is at frequency zero, which gives the correlation length, and that of others
    where the residual itself is, as about a resonance, which gives the mean of the squared density.
    The density is averaged over so many segments.
    """
    _, density = welch(left, nperseg=-(-len(left) // segments))
    return max(correlation_length(left), float(np.mean(density**2) / np.mean(density) ** 2))


def inverse(fit: AxisFit, matrix: Array) -> Array:
    """Inverse of a precision of θ, shape (size, size); raises ScanError where it has none."""
    try:
        factor = cho_factor(fit.layout.conditioned(matrix))
    except LinAlgError as error:
        raise ScanError("the fit diverged: its parameters have no bound") from error
    return np.asarray(cho_solve(factor, np.eye(len(matrix))))
