"""Coupling between the axes, forwards and inverse.

x = x_own + Cx(y_own),    y = y_own + Cy(x_own)
"""

from collections.abc import Collection
from functools import cached_property
from typing import Any

from afm_scan_ros.core.coupled_system import CoupledSystem, SampledCoupling
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Array, Trace

States = dict[str, tuple[Any, ...]]
InverseState = Any
"""``States`` where one axis adds to the other, ``CoupledState`` where both do."""


class Coupling:
    """Coupling of both axes; the state holds those of each axis' coupling elements.

    ``axes`` are those to which the other adds something that counts.
    """

    def __init__(
        self, model: ScannerModel, sample_period: float, axes: Collection[str] = AXES
    ) -> None:
        added = {n: chain_of(model.axis(n)).coupling if n in axes else () for n in AXES}
        self._elements = {n: tuple(e.at(sample_period) for e in added[n]) for n in AXES}
        self._none = not any(self._elements.values())
        self._sample_period = sample_period

    def at_rest(self) -> States:
        """State of a scanner that has long rested at zero."""
        return {name: tuple(e.at_rest() for e in self._elements[name]) for name in AXES}

    def apply(self, state: States, own: Trace) -> tuple[States, Trace]:
        """Displacement (m) of both axes for the own displacement of each."""
        if self._none:
            return state, own
        after, (to_x, to_y) = self._added(state, own)
        return after, Trace(own.first_sample, own.sample_period, own.x + to_x, own.y + to_y)

    @cached_property
    def _coupled(self) -> CoupledSystem | None:
        """Both axes' equations, where each axis adds to the other."""
        if not all(self._elements.values()):
            return None
        to_x, to_y = (SampledCoupling.sum_of(e.sampled for e in self._elements[n]) for n in AXES)
        return CoupledSystem(to_x, to_y, self._sample_period)

    def inverse_at_rest(self) -> InverseState:
        """State of the inverse at rest at zero. Raises InputError where the inverse is unstable."""
        return self._coupled.at_rest() if self._coupled else self.at_rest()

    def invert(self, state: InverseState, target: Trace) -> tuple[InverseState, Trace]:
        """Own displacement of each axis (m) for a target (m) of both.

        Raises InputError where the inverse is unstable, ScanError where a sample has none.
        """
        if self._none:
            return state, target
        if self._coupled:
            return self._coupled.solve(state, target)
        # One axis adds nothing, so that its target is what it does of itself.
        after, (to_x, to_y) = self._added(state, target)
        own = Trace(target.first_sample, target.sample_period, target.x - to_x, target.y - to_y)
        return after, own

    def _added(self, state: States, own: Trace) -> tuple[States, tuple[Array, Array]]:
        """States after, and what is added to x and to y (m)."""
        x_after, to_x = self._added_to("x", state, own.y)
        y_after, to_y = self._added_to("y", state, own.x)
        return {"x": x_after, "y": y_after}, (to_x, to_y)

    def _added_to(self, axis: str, state: States, other: Array) -> tuple[tuple[Any, ...], Array]:
        after, total = [], 0.0 * other
        for element, before in zip(self._elements[axis], state[axis], strict=True):
            new, part = element.apply(before, other)
            after.append(new)
            total = total + part
        return tuple(after), total
