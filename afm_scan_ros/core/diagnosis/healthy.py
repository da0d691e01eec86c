"""Records of the healthy scanner → a model that knows its error on motion of their kind."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.joint.axis import AnyRecord, error_from_start
from afm_scan_ros.core.model import ScannerModel


def with_healthy(model: ScannerModel, healthy: Sequence[Observation]) -> ScannerModel:
    """Return the model with its errors on ordinary records, of the axes that they drive.

    Raises InputError where a drive leaves the identified range.
    """
    for name in model.axes:
        axis = model.axis(name)
        driven = (one for one in healthy if name in one.axes and np.ptp(one.drive.axis(name)))
        errors = [error_from_start(axis, _record(one, name)) for one in driven]
        model = evolve(model, **{name: axis.also_known(errors)})
    return model


def _record(one: Observation, axis: str) -> AnyRecord:
    signals = AxisRecord(one.drive.axis(axis), one.displacement.axis(axis), one.sample_period)
    return AnyRecord(f"healthy: {one.name}", None, signals, one.depolarised)
