"""The displacement that a model predicts for a drive."""

from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.coupling import Coupling
from afm_scan_ros.core.coupling import States as CouplingStates
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Trace


@frozen(eq=False)
class Predicted:
    """How far a prediction has come: the states of both axes, of their coupling, and behind it."""

    own: dict[str, Any]
    coupling: CouplingStates
    output: dict[str, Any]


class Prediction:
    """Drive (V) in, displacement (m) out, block by block; the state is passed in.

    An axis that the model lacks rests at zero.
    """

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
        return Predicted(own, self._coupling.at_rest(), output)

    def advance(self, before: Predicted, drive: Trace) -> tuple[Predicted, Trace]:
        """Return the state after a block, and the displacement during it.

        Raises BeyondRangeError where the drive leaves the identified range.
        """
        own, alone = _applied(self._own, before.own, drive)
        coupling, both = self._coupling.apply(before.coupling, alone)
        output, displacement = _applied(self._output, before.output, both)
        return Predicted(own, coupling, output), displacement


def _applied(
    cascades: dict[str, Cascade], before: dict[str, Any], given: Trace
) -> tuple[dict[str, Any], Trace]:
    states = {}
    moved = {name: np.zeros(len(given.x)) for name in AXES if name not in cascades}
    for name, cascade in cascades.items():
        states[name], moved[name] = cascade.apply(before[name], given.axis(name))
    return states, Trace(given.first_sample, given.sample_period, **moved)


def predict(model: ScannerModel, drive: Trace) -> Trace:
    """Displacement (m) of a whole record from its drive (V), from depolarised rest at zero.

    Raises BeyondRangeError where the drive leaves the identified range.
    """
    prediction = Prediction(model, drive.sample_period)
    return prediction.advance(prediction.at_rest(), drive)[1]
