"""A sensor behind a Bessel filter of fourth order: what it reads is late by the same at every rate.

    x_read / x = 105 / (q^4 + 10 q^3 + 45 q^2 + 105 q + 105),    q = s delay

Its phase is that of a delay up to the seventh power of s; it fades above 2 / delay. Exact for a
displacement that runs straight within a step. Source: W. E. Thomson, Proc. IEE 96 (1949) 487.
"""

from typing import ClassVar

import numpy as np
from attrs import frozen
from attrs.validators import gt

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.dynamics import ComplexArray, fractions
from afm_scan_ros.simulation.mechanisms.base import Insert, Place
from afm_scan_ros.simulation.quantity import quantity
from afm_scan_ros.simulation.spec import RationalSpec

BESSEL = RationalSpec((105.0,), (1.0, 10.0, 45.0, 105.0, 105.0))


@frozen(kw_only=True)
class LinearPhaseSensor(Insert):
    """``delay`` in s; state: the filter's sections and the last displacement, m, shape (3,)."""

    KIND: ClassVar[str] = "linear_phase_sensor"
    PLACE: ClassVar[Place] = "displacement"

    delay: float = quantity(gt(0.0), suffix="_us", scale=1e-6)

    def at_rest(self, step: float, rng: np.random.Generator) -> ComplexArray:  # noqa: ARG002
        """It has seen the scanner at rest."""
        return np.zeros(3, dtype=np.complex128)

    def act(
        self,
        state: ComplexArray,
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[ComplexArray, Array]:
        """Displacement (m) as it is read."""
        poles, residues = fractions(BESSEL)
        upper = poles.imag > 0.0  # one of each conjugate pair
        gains, turns = -2.0 * (residues / poles)[upper], poles[upper] * step / self.delay
        state = state.copy()
        return state, _filter(state, own, turns, gains)


@compiled
def _filter(state: ComplexArray, x: Array, turns: ComplexArray, gains: ComplexArray) -> Array:
    """Sections z' = p (z - x): while x runs straight, z - x tends to its slope over p."""
    read, kept = np.zeros_like(x), np.exp(turns)
    for k in range(x.size):
        moved = x[k] - state[-1].real
        for i in range(turns.size):
            behind = moved / turns[i]
            state[i] = x[k] + behind + kept[i] * (state[i] - state[-1] - behind)
            read[k] += (gains[i] * state[i]).real
        state[-1] = x[k]
    return read
