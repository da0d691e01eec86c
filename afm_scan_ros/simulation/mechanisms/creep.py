"""Mechanisms of creep: of the sample's mount, and of the piezo itself."""

from typing import ClassVar

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import deep_iterable, ge, gt, min_len

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import AxisSpec, quantity, series, with_series
from afm_scan_ros.simulation.mechanisms.base import Alteration, Insert


@frozen(kw_only=True)
class CreepingMount(Insert):
    """A mount that creeps under the sample: springs and dashpots in series with the scanner.

        tau_i dz_i/dt = x - z_i
        x_out = x + share sum_i z_i

    Elements with time constants in geometric progression creep with the logarithm of time, as glue
    and clamped joints do. Exact for a motion that is linear within a step. ``share`` is the part of
    the displacement by which each element creeps, ``taus`` are the time constants, s.

    State: the elements' elongations z (m), shape (elements,), and the last displacement, m.
    """

    KIND: ClassVar[str] = "creeping_mount"

    share: float = quantity()
    taus: tuple[float, ...] = field(
        validator=[min_len(1), deep_iterable(gt(0.0))], metadata={"suffix": "_s", "scale": 1.0}
    )

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[Array, float]:  # noqa: ARG002
        """Nothing has crept."""
        return np.zeros(len(self.taus)), 0.0

    def act(
        self,
        state: tuple[Array, float],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[Array, float], Array]:
        """Displacement (m) with what has crept."""
        elements, last = state[0].copy(), state[1]
        crept = _creep(own, last, elements, step / np.array(self.taus))
        return (elements, float(own[-1])), own + self.share * crept


@compiled
def _creep(displacement: Array, last: float, elements: Array, steps: Array) -> Array:
    done = -np.expm1(-steps)
    crept = np.empty_like(displacement)
    for k in range(displacement.size):
        middle = 0.5 * (last + displacement[k])
        last = displacement[k]
        for i in range(elements.size):
            elements[i] += done[i] * (middle - elements[i])
        crept[k] = elements.sum()
    return crept


@frozen(kw_only=True)
class AgedCreep(Alteration):
    """A piezo whose creep has changed with age.

        g' = factor g

    ``factor`` multiplies the gain of every element of the creep; the time constants stay.
    """

    KIND: ClassVar[str] = "aged_creep"

    factor: float = quantity(ge(0.0))

    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Creep further by the factor, as fast."""
        gains, taus = series(axis.creep)
        return evolve(axis, creep=with_series(axis.creep, self.factor * gains, taus))
