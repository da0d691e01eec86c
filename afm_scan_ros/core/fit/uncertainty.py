"""How well a fit knows its parameters, and what it predicts.

Near the most probable θ the posterior is normal, with the covariance (H + Λ)⁻¹ of the normal
equations' H and the prior's precision Λ. What no record tells keeps the prior's width.
"""

from functools import partial

import numpy as np
from attrs import frozen
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.signal import welch

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.sensitivity import jacobian
from afm_scan_ros.core.fit.signals import Signals, correlation_length
from afm_scan_ros.core.fit.simulation import simulate
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class PredictedMotion:
    """Displacement from depolarised rest and its standard deviation, both (n,) and in m.

    ``standard_deviation`` holds that of the parameters and the discrepancy η of the fit, but not
    the sensor's noise.
    """

    displacement: Array
    standard_deviation: Array


def information(fit: AxisFit) -> Array:
    """H of the normal equations, as if samples whose residuals are alike were one sample."""
    lefts = fit.residuals()
    matrix = np.zeros((fit.layout.size,) * 2)
    for k, left in enumerate(lefts):
        given = fit.records[k].gathered(left), fit.columns(k, with_operator=True)
        of_record, _ = fit.products(k, *given)
        matrix += of_record / samples_alike(left, fit.layout.settings.residual_segments)
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


def covariance(fit: AxisFit) -> Array:
    """Covariance of θ, shape (size, size)."""
    precision, _ = fit.layout.prior(fit.scales, fit.theta)
    return inverse(fit, information(fit) + precision)


def inverse(fit: AxisFit, matrix: Array) -> Array:
    """Inverse of a precision of θ, shape (size, size); raises ScanError where it has none."""
    try:
        factor = cho_factor(fit.layout.conditioned(matrix))
    except LinAlgError as error:
        raise ScanError("the fit diverged: its parameters have no bound") from error
    return np.asarray(cho_solve(factor, np.eye(len(matrix))))


def predicted(fit: AxisFit, drive: Array, period: float) -> PredictedMotion:
    """Predict the displacement under a drive (V), (n,), that begins at 0 V at depolarised rest.

    Raises InputError where the drive begins elsewhere, or leaves the range of the records.
    """
    operator, count = fit.layout.operator, len(drive)
    if drive[0] != 0.0:
        raise InputError(f"the drive begins at {drive[0]:.4g} V: let it begin at rest, at 0 V")
    if drive.min() < operator.lower or drive.max() > operator.upper:
        raise InputError(
            f"the drive reaches {drive.min():.4g} to {drive.max():.4g} V, but the records only"
            f" {operator.lower:.4g} to {operator.upper:.4g} V"
        )
    given, edges = ("prediction", drive, np.zeros(count), period, 1, 0), np.arange(count + 1)
    record = Signals(*given, rested=True, noise=0.0, edges=edges)
    simulation = simulate(fit.layout, fit.theta, record)
    moved = fit.gain * (simulation.output - simulation.output[0])
    theta = fit.layout.of_operator(fit.theta)
    pieces = operator.pieces(theta, drive, edges, fit.layout.start_of(fit.theta, record)[0])
    variance, rest = np.empty(count), None
    spread = partial(np.einsum, "ij,jk,ik->i", optimize=True)
    known = covariance(fit)
    for rows, piece in jacobian(simulation, pieces):
        rest = piece[0].copy() if rest is None else rest
        change = fit.gain * (piece - rest)
        variance[rows] = spread(change, known, change)
    discrepancy = fit.discrepancy * float(np.std(moved))
    return PredictedMotion(moved, np.sqrt(variance + discrepancy**2))
