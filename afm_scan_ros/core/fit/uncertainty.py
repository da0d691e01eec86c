"""How well a fit knows its parameters.

Near the most probable θ the posterior is normal, with the covariance (H + Λ)⁻¹ of the normal
equations' H and the prior's precision Λ. What no record tells keeps the prior's width.
"""

from collections.abc import Iterable

import numpy as np
from scipy.linalg import cholesky, eigh, qr, solve_triangular
from scipy.signal import welch

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.noise import correlation_length
from afm_scan_ros.core.fit.parameters import Layout
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


def covariance(layout: Layout, told: Array, prior: Array) -> Array:
    """(H + Λ)⁻¹ of what the records have ``told`` and of the prior, each of shape (size, size).

    Both are joined by their square roots, in units of the diagonal of H + Λ. What H holds below its
    own rounding is taken as not told: there the prior alone is left, which has a bound.
    """
    units = np.sqrt(np.diag(told) + np.diag(prior))
    values, vectors = eigh(told / np.outer(units, units))
    seen = values > len(values) * np.finfo(float).eps * values[-1]
    known = np.sqrt(values[seen, None]) * vectors[:, seen].T
    own = cholesky(layout.conditioned(prior)) / units
    upper = qr(np.concatenate([known, own]), mode="r")[0][: len(units)]
    inverse = solve_triangular(upper, np.eye(len(units))) / units[:, None]
    return np.asarray(inverse @ inverse.T)
