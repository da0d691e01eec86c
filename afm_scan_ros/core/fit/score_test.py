"""What a mode would explain that a fit lacks: Rao's score test.

A mode of pole p is tried with a weight κ of zero, about which the fit is linear. Were all other
parameters θ fitted anew with it, the objective would fall by

    ½ gᵀ κ,    κ = S⁻¹ g,    S = H_κκ - H_κθ H_θθ⁻¹ H_θκ,    g = b_κ - H_κθ H_θθ⁻¹ b_θ,

with the normal equations' H and b. H_θθ is made once for all modes; H_θκ is the transposed Jacobian
times the derivatives by κ.
Source: C. R. Rao, Math. Proc. Camb. Phil. Soc. 44 (1948) 50.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from typing import TypeAlias

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.parameters import Columns, Mode
from afm_scan_ros.core.fit.simulation import pulled
from afm_scan_ros.core.types import Array, Complex

Place: TypeAlias = tuple[float, float]
"""Angular frequency (rad/s) and damping."""


@frozen
class FoundMode:
    """A mode, by how much (nat) it lowers the objective, and the static gain over that before."""

    mode: Mode
    chance: float
    gain: float


class ScoreTest:
    """A test of modes beside the ``free`` parameters (size,) of a fit, which are fitted anew."""

    def __init__(self, fit: AxisFit, free: NDArray[np.bool_]) -> None:
        self.fit, self.free = fit, np.flatnonzero(free)
        self.with_operator = bool(free[: fit.layout.parts["map"].stop].any())
        self._left = fit.gathered()
        self._pieces: list[list[Columns] | None] = [
            list(fit.pieces(k)) if self.with_operator else None for k in range(len(fit.records))
        ]
        matrix, right = fit.normal(with_operator=self.with_operator)
        self._matrix, self._right = matrix[np.ix_(self.free, self.free)], right[self.free]

    def of(self, places: Sequence[Place]) -> Iterator[FoundMode]:
        """Yield what each mode explains; so many are tried at a time as memory holds."""
        rows = max(len(one.weights) for one in self.fit.records)
        at_once = max(self.fit.layout.settings.mode_values // rows, 1)
        for first in range(0, len(places), at_once):
            yield from self._of(places[first : first + at_once])

    def _of(self, places: Sequence[Place]) -> Iterator[FoundMode]:
        fit, layout, kept = self.fit, self.fit.layout, self.free
        wider = copy(fit)
        for omega, damping in places:
            wider.add((omega, damping, 0.0, 0.0))
        last = layout.parts["modes"].stop
        weights = last + (4 * np.arange(len(places))[:, np.newaxis] + [2, 3]).ravel()
        new = slice(layout.modes, wider.layout.modes)
        own, shared, pull = self._products(wider.layout.dynamics(wider.theta).poles[new])
        within_wider = np.where(kept < last, kept, kept + 4 * len(places))
        precision, mean = wider.layout.prior(fit.scales, wider.theta)
        apart = precision @ (wider.theta - mean)
        if not self.with_operator:
            precision = precision - wider.layout.unit_gain
        whole = self._matrix + precision[np.ix_(within_wider, within_wider)]
        try:
            factor = cho_factor(layout.conditioned(whole))
        except np.linalg.LinAlgError:  # rounding hides what a mode would add
            return
        shared = shared + precision[np.ix_(within_wider, weights)]
        own = layout.conditioned(own + precision[np.ix_(weights, weights)])
        alone = cho_solve(factor, self._right - apart[within_wider])
        along = cho_solve(factor, shared)
        pull = pull - apart[weights] - shared.T @ alone
        beyond, static = own - shared.T @ along, layout.static[kept]
        for k, (omega, damping) in enumerate(places):
            both = slice(2 * k, 2 * k + 2)
            pair = np.linalg.solve(beyond[both, both], pull[both])
            gain = 1.0
            if not self.with_operator:
                gain = float(1.0 + pair[0] + static @ (alone - along[:, both] @ pair))
            mode = omega, damping, float(pair[0]) / gain, float(pair[1]) / gain
            yield FoundMode(mode, 0.5 * float(pull[both] @ pair), gain)

    def _products(self, poles: Complex) -> tuple[Array, Array, Array]:
        """H_κκ, H_θκ and b_κ of the weights of modes of some poles (rad/s), (n,)."""
        fit, count = self.fit, 2 * len(poles)
        own, shared = np.zeros((count, count)), np.zeros((len(self.free), count))
        pull, here = np.zeros(count), fit.simulated(fit.theta)
        every = zip(fit.records, here, self._pieces, self._left, strict=True)
        for k, (record, simulation, pieces, left) in enumerate(every):
            columns = simulation.by_weights(poles)[record.stretches]
            columns *= fit.gain * record.weights[:, np.newaxis]
            free, variance = fit.free_of(k, gathered=True), fit.variance(record)
            alone = free.without(columns) / variance
            own += columns.T @ alone
            pull += columns.T @ left / variance
            shared += fit.gain * pulled(simulation, pieces, alone)[self.free]
        return own, shared, pull
