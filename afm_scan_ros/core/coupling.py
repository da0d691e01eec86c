"""What each axis adds to the other, forwards and inverse.

x = x_own + Cx(y_own),    y = y_own + Cy(x_own)
"""

from collections.abc import Collection
from typing import Any

from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Array, Trace

ROUNDS = 12
"""Of the fixed point of the inverse: each gains the product of both couplings, below 0.1."""
States = dict[str, tuple[Any, ...]]


class Coupling:
    """Coupling of both axes; the state holds those of each axis' coupling elements.

    ``axes`` are those to which the other adds something that counts.
    """

    def __init__(
        self, model: ScannerModel, sample_period: float, axes: Collection[str] = AXES
    ) -> None:
        added = {n: chain_of(model.axis(n)).coupling if n in axes else () for n in AXES}
        self._elements = {n: tuple(e.at(sample_period) for e in added[n]) for n in AXES}
        self._one_way, self._none = (not kind(self._elements.values()) for kind in (all, any))

    def at_rest(self) -> States:
        """State of a scanner that has long rested at zero."""
        return {name: tuple(e.at_rest() for e in self._elements[name]) for name in AXES}

    def apply(self, state: States, own: Trace) -> tuple[States, Trace]:
        """Displacement (m) of both axes for what each does of itself."""
        if self._none:
            return state, own
        x_state, to_x = self._added("x", state, own.y)
        y_state, to_y = self._added("y", state, own.x)
        coupled = Trace(own.first_sample, own.sample_period, own.x + to_x, own.y + to_y)
        return {"x": x_state, "y": y_state}, coupled

    def invert(self, state: States, target: Trace) -> tuple[States, Trace]:
        """What each axis is to do of itself for a target (m) of both: a fixed point."""
        if self._none:
            return state, target
        x, y = target.x, target.y
        for _ in range(2 if self._one_way else ROUNDS):
            x_state, to_x = self._added("x", state, y)
            x = target.x - to_x
            y_state, to_y = self._added("y", state, x)
            y = target.y - to_y
        own = Trace(target.first_sample, target.sample_period, x, y)
        return {"x": x_state, "y": y_state}, own

    def _added(self, axis: str, state: States, other: Array) -> tuple[tuple[Any, ...], Array]:
        after, total = [], 0.0 * other
        for element, before in zip(self._elements[axis], state[axis], strict=True):
            new, part = element.apply(before, other)
            after.append(new)
            total = total + part
        return tuple(after), total
