"""What of an effect is another in every record, as a disturbance's phase, told for a record."""

import numpy as np
from attrs import evolve
from scipy.optimize import least_squares

from afm_scan_ros.core.effects.registry import entry
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.settled import settled
from afm_scan_ros.core.types import AXES, Array

NANO = 1e9  # so that the solver's tolerances mean something
Places = list[tuple[int, int]]
"""Number of the effect on its axis, and of the parameter in it."""


def left_of(model: ScannerModel, scan: Scan, axis: str) -> Array:
    """Measured minus predicted displacement (n,) in m of one axis, its mean left out."""
    left = scan.measured.axis(axis) - predict(model, scan.drive).axis(axis)
    return np.asarray(left - left.mean())


def told_by(model: ScannerModel, scan: Scan) -> ScannerModel:
    """Model with those parameters fitted to a scan that are each record's own.

    Most have none, and so are the model itself.
    """
    for axis in AXES:
        if places := _own(model, axis):
            model = _fitted(model, scan, axis, places)
    return model


def _fitted(model: ScannerModel, scan: Scan, axis: str, places: Places) -> ScannerModel:
    def left(values: Array) -> Array:
        return NANO * left_of(_with(model, axis, places, values / NANO), scan, axis)

    start = [NANO * model.axis(axis).added[i].values[j] for i, j in places]
    fitted = settled(least_squares(left, start), f"{axis}: what differs from scan to scan")
    return _with(model, axis, places, fitted / NANO)


def _own(model: ScannerModel, axis: str) -> Places:
    """Effect and parameter of each that is a record's own."""
    return [
        (i, j)
        for i, added in enumerate(model.axis(axis).added)
        for j, parameter in enumerate(entry(added.name).form(added.kind).parameters)
        if parameter.own
    ]


def _with(model: ScannerModel, axis: str, places: Places, values: Array) -> ScannerModel:
    new = [list(added.values) for added in model.axis(axis).added]
    for (i, j), value in zip(places, values, strict=True):
        new[i][j] = float(value)
    olds = model.axis(axis).added
    added = tuple(Added(o.name, o.kind, tuple(v)) for o, v in zip(olds, new, strict=True))
    return evolve(model, **{axis: evolve(model.axis(axis), added=added)})
