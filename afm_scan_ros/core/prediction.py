"""What a model makes of a drive: the displacement of both axes."""

from typing import Any

from attrs import frozen

from afm_scan_ros.core.coupling import Coupling
from afm_scan_ros.core.coupling import States as CouplingStates
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import AXES, Trace


@frozen(eq=False)
class Predicted:
    """How far a prediction has come: the states of both axes and of what couples them."""

    own: dict[str, Any]
    coupling: CouplingStates


class Prediction:
    """Drive (V) in, displacement (m) out, block by block; the state is passed in."""

    def __init__(self, model: ScannerModel, sample_period: float) -> None:
        self._cascades = {name: forward(model.axis(name), sample_period) for name in AXES}
        self._coupling = Coupling(model, sample_period)

    def at_rest(self) -> Predicted:
        """State of a scanner at depolarised rest at zero."""
        own = {name: cascade.at_rest() for name, cascade in self._cascades.items()}
        return Predicted(own, self._coupling.at_rest())

    def advance(self, before: Predicted, drive: Trace) -> tuple[Predicted, Trace]:
        """Return the state after a block, and the displacement during it.

        Raises BeyondRangeError where the drive leaves the identified range.
        """
        states, moved = {}, {}
        for name, cascade in self._cascades.items():
            states[name], moved[name] = cascade.apply(before.own[name], drive.axis(name))
        own = Trace(drive.first_sample, drive.sample_period, **moved)
        coupling, displacement = self._coupling.apply(before.coupling, own)
        return Predicted(states, coupling), displacement


def predict(model: ScannerModel, drive: Trace) -> Trace:
    """Displacement (m) of a whole record from its drive (V), from depolarised rest at zero.

    Raises BeyondRangeError where the drive leaves the identified range.
    """
    prediction = Prediction(model, drive.sample_period)
    return prediction.advance(prediction.at_rest(), drive)[1]
