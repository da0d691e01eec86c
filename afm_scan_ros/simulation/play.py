"""Hysteresis of the simulated scanner: a bank of play operators between two quadratics.

The field v = u + input_quadratic u^2 follows from the drive u, and each play of threshold r
follows the field at a distance of at most r,

    p_r <- min(max(p_r, v - r), v + r)
    w = v + sum_r rho(r) dr p_r,    F = gain w + output_quadratic w^2.

Thresholds begin at (almost) zero, so that no drive is too small for hysteresis: a small
oscillation follows Rayleigh's law. The quadratics make the loop asymmetric. That of the output
makes minor loops incongruent, that of the input those of the inverse (from F to u), so that a
Preisach operator of either needs a memoryless map beside it to represent this plant.
Assumptions: independent of rate and of the load. Source: M. Brokate and J. Sprekels, Hysteresis
and Phase Transitions, Springer 1996 (plays); Lord Rayleigh, 1887 (the law at small signals).
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis_spec import HysteresisSpec


@frozen(eq=False)
class PlayBank:
    """Plays of ``thresholds`` (V) with ``weights`` (1), ``gain`` (1), and both quadratics (1/V).

    State: positions of all plays, V, shape (elements,).
    """

    thresholds: Array
    weights: Array
    gain: float
    input_quadratic: float
    output_quadratic: float

    @classmethod
    def from_spec(cls, spec: HysteresisSpec) -> "PlayBank":
        """Discretise the density ``density * exp(-r / decay)``, finest near r = 0."""
        edges = spec.threshold_max * (np.arange(spec.elements + 1) / spec.elements) ** 2
        thresholds = (edges[1:] + edges[:-1]) / 2.0
        weights = spec.density * np.exp(-thresholds / spec.decay) * np.diff(edges)
        quadratics = (spec.input_quadratic, spec.output_quadratic)
        return cls(thresholds, weights, spec.gain, *quadratics)

    def relaxed(self) -> Array:
        """State of a virgin scanner: never driven, every play in its middle."""
        return np.zeros_like(self.thresholds)

    def apply(self, plays: Array, drive: Array) -> tuple[Array, Array]:
        """Effective input F (V) for a block of drive (V), both of shape (n,)."""
        plays = plays.copy()
        total = _follow(self.field(drive), self.thresholds, self.weights, plays)
        return plays, self.effective(total)

    def field(self, drive: Array) -> Array:
        """Field v (V) that the plays follow."""
        return drive + self.input_quadratic * drive**2

    def effective(self, total: Array) -> Array:
        """Effective input F (V) of the field and all plays together, w (V)."""
        return (self.gain + self.output_quadratic * total) * total


@compiled
def _follow(field: Array, thresholds: Array, weights: Array, plays: Array) -> Array:
    total = np.empty_like(field)
    for k in range(field.size):
        v = field[k]
        if k > 0 and v == field[k - 1]:  # held: no play moves
            total[k] = total[k - 1]
            continue
        for i in range(plays.size):
            plays[i] = min(max(plays[i], v - thresholds[i]), v + thresholds[i])
        total[k] = v + np.dot(weights, plays)
    return total
