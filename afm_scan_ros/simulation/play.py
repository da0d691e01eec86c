"""Hysteresis of the simulated scanner: a bank of play operators behind a quadratic output.

Each play of threshold r follows the drive u at a distance of at most r,

    p_r <- min(max(p_r, u - r), u + r)
    w = u + sum_r rho(r) dr p_r,    F = gain w + quadratic w^2.

Thresholds begin at (almost) zero, so that no drive is too small for hysteresis: a small
oscillation follows Rayleigh's law. The quadratic output makes the loop asymmetric and minor loops
incongruent, which no Preisach model can represent: identified on this plant, one keeps an error.
Assumptions: independent of rate and of the load. Source: M. Brokate and J. Sprekels, Hysteresis
and Phase Transitions, Springer 1996 (plays); Lord Rayleigh, 1887 (the law at small signals).
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.spec import HysteresisSpec


@frozen(eq=False)
class PlayBank:
    """Plays of ``thresholds`` (V) with ``weights`` (1); ``gain`` (1) and ``quadratic`` (1/V).

    State: positions of all plays, V, shape (elements,).
    """

    thresholds: Array
    weights: Array
    gain: float
    quadratic: float

    @classmethod
    def from_spec(cls, spec: HysteresisSpec) -> "PlayBank":
        """Discretise the density ``density * exp(-r / decay)``, finest near r = 0."""
        edges = spec.threshold_max * (np.arange(spec.elements + 1) / spec.elements) ** 2
        thresholds = (edges[1:] + edges[:-1]) / 2.0
        weights = spec.density * np.exp(-thresholds / spec.decay) * np.diff(edges)
        return cls(thresholds, weights, spec.gain, spec.quadratic)

    def relaxed(self) -> Array:
        """State of a virgin scanner: never driven, every play in its middle."""
        return np.zeros_like(self.thresholds)

    def apply(self, plays: Array, drive: Array) -> tuple[Array, Array]:
        """Effective input F (V) for a block of drive (V), both of shape (n,)."""
        plays = plays.copy()
        total = _follow(drive, self.thresholds, self.weights, plays)
        return plays, (self.gain + self.quadratic * total) * total


@compiled
def _follow(drive: Array, thresholds: Array, weights: Array, plays: Array) -> Array:
    total = np.empty_like(drive)
    for k in range(drive.size):
        u = drive[k]
        for i in range(plays.size):
            plays[i] = min(max(plays[i], u - thresholds[i]), u + thresholds[i])
        total[k] = u + np.dot(weights, plays)
    return total
