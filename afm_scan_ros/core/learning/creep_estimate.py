"""Slow creep beyond the model's from the means of lines, by least squares with forgetting.

The mean residual of line L is a constant + (g - 1) ŷ + c z, with the line's means of ŷ and z. Lines
are forgotten with the creep's own time constant. What is left must be within the detection limit
below half the line rate: else the motion is a drift, and not this creep.
"""

from math import exp

import numpy as np
from attrs import frozen

from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.learning.axis_shift import room
from afm_scan_ros.core.learning.line_signals import GAIN, LineSignals
from afm_scan_ros.core.types import Array

ROOM = room()[[3, 0]]
"""Of c and g - 1."""


@frozen
class CreepEstimate:
    """c, its standard deviation by the model's error, and the rms (m) that it leaves."""

    change: float
    model_error: float
    left: float


class CreepInformation:
    """Sums over lines of products of (1, z, ŷ, residual), shape (4, 4); the state is passed in."""

    def __init__(self, limit: DetectionLimit, time_constant: float, line_rate: float) -> None:
        slow = np.array(limit.edges[:-1]) < 0.5 * line_rate
        self.limit = float(np.linalg.norm(limit.rms[slow]))
        self._kept = exp(-1.0 / (time_constant * line_rate))

    def at_rest(self) -> Array:
        """No line was seen."""
        return np.zeros((4, 4))

    def after(self, before: Array, line: LineSignals) -> Array:
        """Return the sums after one more line."""
        predicted = line.parts[GAIN]
        means = np.array([1.0, line.creep.mean(), predicted.mean(), line.residual.mean()])
        return np.asarray(self._kept * before + np.outer(means, means))

    def estimate(self, sums: Array) -> CreepEstimate:
        """Estimate c; without any line, with the prior's deviation."""
        mean = sums[0, 1:] / max(sums[0, 0], 1.0)
        products = (sums[1:, 1:] / max(sums[0, 0], 1.0) - np.outer(mean, mean)) / self.limit**2
        covariance = np.linalg.inv(products[:2, :2] + np.diag(ROOM**-2.0))
        unknowns = covariance @ products[:2, 2]
        explained = unknowns @ (2.0 * products[:2, 2] - products[:2, :2] @ unknowns)
        left = self.limit * float(np.sqrt(max(products[2, 2] - explained, 0.0)))
        return CreepEstimate(float(unknowns[0]), float(np.sqrt(covariance[0, 0])), left)
