"""A model's cascades with the effects added to it, its coupled axes, and what it predicts.

The displacements of coupled axes are x = x_own + Cx(y_own),    y = y_own + Cy(x_own)
"""

from collections.abc import Collection
from functools import cached_property
from typing import Any

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.coupled_system import CoupledSystem, sum_of
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.sensor import led
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.intersample import HELD
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Array, Trace


def chain_of(axis: AxisModel) -> Chain:
    """Return the chain of one axis; raises InputError at the effect that cannot stand in it."""
    chain = Chain(axis)
    for place, added in enumerate(axis.added):
        try:
            form = effect_type(added.name).form(added.kind)
            chain = form.insert(chain, np.array(added.values))
        except InputError as error:
            raise InputError(f"added[{place}]: {added.name}: {error}") from error
    return chain


def forward(axis: AxisModel, sample_period: float) -> Cascade:
    """Return the model of one axis, from drive (V) to its own displacement (m)."""
    return chain_of(axis).forward(sample_period)


States = dict[str, Array]
InverseState = Any
"""``States`` where one axis adds to the other, ``CoupledState`` where both do."""


class Coupling:
    """Coupling of both axes, or of those given; the state is that of what is added to each."""

    def __init__(
        self, model: ScannerModel, sample_period: float, axes: Collection[str] = AXES
    ) -> None:
        added = {n: chain_of(model.axis(n)).coupling if n in axes else () for n in AXES}
        self._to = {
            name: sum_of((each.at(sample_period) for each in elements), sample_period)
            for name, elements in added.items()
        }
        self._none, self._both = not any(added.values()), all(added.values())
        self._sample_period = sample_period

    def at_rest(self) -> States:
        """State of a scanner that has long rested at zero."""
        return {name: added.at_rest() for name, added in self._to.items()}

    def apply(self, state: States, own: Trace) -> tuple[States, Trace]:
        """Displacement (m) of both axes for the own displacement of each."""
        if self._none:
            return state, own
        after, (to_x, to_y) = self._added(state, own)
        return after, Trace(own.first_sample, own.sample_period, own.x + to_x, own.y + to_y)

    @cached_property
    def _coupled(self) -> CoupledSystem | None:
        """Both axes' equations, where each axis adds to the other."""
        if not self._both:
            return None
        return CoupledSystem(self._to["x"], self._to["y"], self._sample_period)

    def inverse_at_rest(self) -> InverseState:
        """State of the inverse at rest at zero. Raises InputError where the inverse is unstable."""
        return self._coupled.at_rest() if self._coupled else self.at_rest()

    def invert(self, state: InverseState, target: Trace) -> tuple[InverseState, Trace]:
        """Own displacement (m) of each axis for a target (m) of both; InputError where unstable."""
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
        x_after, to_x = self._to["x"].apply(state["x"], own.y)
        y_after, to_y = self._to["y"].apply(state["y"], own.x)
        return {"x": x_after, "y": y_after}, (to_x, to_y)


Predicted = tuple[dict[str, Any], States, dict[str, Any]]
"""How far a prediction has come: the states of both axes, of their coupling, and behind it."""


class Prediction:
    """Drive (V) in, displacement (m) out, by blocks; an axis that the model lacks rests at zero."""

    def __init__(self, model: ScannerModel, sample_period: float) -> None:
        chains = {name: chain_of(model.axis(name)) for name in model.axes}
        self._own = {name: chain.alone(sample_period) for name, chain in chains.items()}
        self._output = {name: chain.output_of(sample_period) for name, chain in chains.items()}
        self._coupling = Coupling(model, sample_period, model.axes)

    def at_rest(self) -> Predicted:
        """State of a scanner at depolarised rest at zero."""
        own, output = (
            {name: cascade.at_rest() for name, cascade in cascades.items()}
            for cascades in (self._own, self._output)
        )
        return own, self._coupling.at_rest(), output

    def advance(self, before: Predicted, drive: Trace) -> tuple[Predicted, Trace]:
        """Return state and displacement after a block; BeyondRangeError beyond the range."""
        own, alone = _applied(self._own, before[0], drive)
        coupling, both = self._coupling.apply(before[1], alone)
        output, displacement = _applied(self._output, before[2], both)
        return (own, coupling, output), displacement


def _applied(
    cascades: dict[str, Cascade], before: dict[str, Any], given: Trace
) -> tuple[dict[str, Any], Trace]:
    states = {}
    moved = {name: np.zeros(len(given.x)) for name in AXES if name not in cascades}
    for name, cascade in cascades.items():
        states[name], moved[name] = cascade.apply(before[name], given.axis(name))
    return states, Trace(given.first_sample, given.sample_period, **moved)


def synchronised(model: ScannerModel, record: Record) -> Record:
    """Return a record with a held drive as if it were read just before the drive's updates."""
    if record.intersample != HELD:
        return record
    drive = record.drive.copy()
    for channel, axis in enumerate(record.axes):
        if axis in model.axes and model.axis(axis).reads_after:
            drive[:, channel] = led(drive[:, channel])
    return evolve(record, drive=drive)


def predict(model: ScannerModel, drive: Trace) -> Trace:
    """Displacement (m) for a drive (V) from rest; BeyondRangeError beyond the identified range."""
    prediction = Prediction(model, drive.sample_period)
    return prediction.advance(prediction.at_rest(), drive)[1]
