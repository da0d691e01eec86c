"""Creep: the slow motion that follows every step, by springs and dampers in series.

Gc(s) = 1 + Σ gᵢ / (1 + s τᵢ), the series of Croft, Shed and Devasia (2001), Eq. 1,
divided by its elastic part 1/k₀, so that Gc → 1 at high frequency. gᵢ is dimensionless, τᵢ in s.
Assumption: the input is constant between samples, so that the sampled step response is exact.

One step of a section decays its state by exp(-T/τ). For T = 10 µs and τ = 1700 s that factor is
1 - 6e-9, and rounding it to a double already shifts τ by 1e-8. So the steps are increments by
expm1(-T/τ), which is exact to the last digit.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import Recursion
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, floats


@frozen
class CreepModel:
    """Gains (1) and time constants (s > 0) of the sections; InputError unless these pair."""

    gains: tuple[float, ...] = field(converter=floats)
    time_constants: tuple[float, ...] = field(converter=floats)

    def __attrs_post_init__(self) -> None:
        if len(self.gains) != len(self.time_constants):
            raise InputError(
                f"creep has {len(self.gains)} gains and {len(self.time_constants)} time_constants:"
                " give one of each for every section"
            )
        if not np.isfinite([*self.gains, *self.time_constants]).all():
            raise InputError("creep gains and time_constants must be finite numbers")
        if min(self.time_constants, default=1.0) <= 0.0:
            raise InputError(f"creep time_constants must be positive: {self.time_constants}")


@compiled
def _run(
    state: Array, gains: Array, decay: Array, block: Array, direction: float, result: Array
) -> None:
    for k in range(block.size):
        result[k] = block[k]
        for i in range(state.size):
            result[k] += direction * state[i]
        u = block[k] if direction > 0.0 else result[k]
        for i in range(state.size):
            state[i] += decay[i] * (state[i] - gains[i] * u)


class Creep(Recursion):
    """Creep of one axis (m), with its exact inverse; the state is the output of each section."""

    def __init__(self, model: CreepModel, sample_period: float) -> None:
        self._gains = np.array(model.gains)
        self._decay = np.expm1(-sample_period / np.array(model.time_constants))

    def at_rest(self) -> Array:
        """State of a scanner that has long rested at zero."""
        return np.zeros_like(self._gains)

    def run(self, state: Array, block: Array, direction: float) -> tuple[Array, Array]:
        """State, and displacement with or without creep."""
        state, result = state.copy(), np.empty(len(block))
        _run(state, self._gains, self._decay, block, direction, result)
        return state, result
