"""The mode that a fit lacks most: each candidate's response to F against the residuals."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.parameters import Mode
from afm_scan_ros.core.fit.sensitivity import Simulation
from afm_scan_ros.core.types import Array


@frozen
class FoundMode:
    """A mode, by how much it lowers the misfit, and the static gain with it over that before."""

    explained: float
    mode: Mode
    gain: float


def best_mode(fit: AxisFit) -> FoundMode:
    """Return the mode that lowers the misfit most.

    The search goes over all frequencies that the records resolve, in steps of a half-power
    bandwidth, and then about the best of them.
    """
    simulations = fit.simulated(fit.theta)
    given = simulations, fit.residuals(simulations)
    damping = fit.layout.settings.damping
    lowest = min(40.0 * np.pi / (record.blocks * record.length) for record in fit.records)
    highest = max(0.8 * np.pi / record.length for record in fit.records)
    count = 2 + int(np.log(highest / lowest) / (2.0 * damping))
    best = max(
        (_explained(fit, *given, omega, damping) for omega in np.geomspace(lowest, highest, count)),
        key=lambda found: found.explained,
    )
    for _ in range(3):
        omega, damping, *_ = best.mode
        near = [
            (omega * (1.0 + shift * damping), damping * factor)
            for shift in (-1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0)
            for factor in (0.4, 0.7, 1.0, 1.6)
        ]
        tried = (_explained(fit, *given, *one) for one in near)
        best = max(tried, key=lambda found: found.explained)
    return best


def _explained(
    fit: AxisFit,
    simulations: Sequence[Simulation],
    lefts: Sequence[Array],
    omega: float,
    damping: float,
) -> FoundMode:
    """Fit the weight κ of a mode: what it gets, the vibration so far loses. The gain is free."""
    pole = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
    sums = np.zeros((4, 4))
    for record, simulation, left in zip(fit.records, simulations, lefts, strict=True):
        if omega * record.length > 0.9 * np.pi:
            continue
        z, early = np.exp(pole * record.period), fit.gain * simulation.response.output
        signals = simulation.effective, early[record.used], left
        place = record.block, record.used.start, simulation.settled
        sums += _products(z, fit.gain, *signals, *place) / fit.variance(record)
    matrix, right = sums[:3, :3], sums[:3, 3]
    ridge = np.finfo(float).eps * np.trace(matrix) + 1e-300
    real, imag, more = found = np.linalg.solve(matrix + ridge * np.eye(3), right)
    gain = 1.0 + float(more)
    if np.hypot(real, imag) > fit.layout.settings.heaviest_mode * abs(gain):
        return FoundMode(0.0, (omega, damping, 0.0, 0.0), 1.0)
    mode = omega, damping, float(real) / gain, float(imag) / gain
    return FoundMode(float(0.5 * right @ found), mode, gain)


@compiled
def _products(  # noqa: PLR0913, PLR0917 - a compiled loop takes arrays, not objects
    z: complex,
    gain: float,
    inputs: Array,
    early: Array,
    left: Array,
    block: int,
    first: int,
    settled: float,
) -> Array:
    """Products of deviations from their means, of means over blocks, shape (4, 4).

    They are of a mode's real part without ``early``, its imaginary part, ``early``, and ``left``.
    """
    total, products, row = np.zeros(4), np.zeros((4, 4)), np.zeros(4)
    x = settled + 0j
    for b in range(first + left.size):
        mean = 0j
        for k in range(b * block, (b + 1) * block):
            mean += x
            x = inputs[k] + z * (x - inputs[k])
        if b < first:
            continue
        mean *= gain / block
        row[:] = mean.real - early[b - first], -mean.imag, early[b - first], left[b - first]
        for i in range(4):
            total[i] += row[i]
            for j in range(4):
                products[i, j] += row[i] * row[j]
    for i in range(4):
        for j in range(4):
            products[i, j] -= total[i] * total[j] / left.size
    return products
