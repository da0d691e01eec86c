"""Records of the healthy scanner → a model that knows its error on motion of their kind."""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.diagnosis.cautions import UnlikeHealthy
from afm_scan_ros.core.diagnosis.likelihood import Likelihood
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.joint.axis import AnyRecord, error_from_start
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of


def with_healthy(model: ScannerModel, healthy: Sequence[Observation]) -> ScannerModel:
    """Return the model with its errors on ordinary records, of the axes that they drive.

    Raises InputError where a drive leaves the identified range.
    """
    for name in model.axes:
        axis = model.axis(name)
        errors = [error_from_start(axis, _record(one, name)) for one in _driven(healthy, name)]
        model = evolve(model, **{name: axis.also_known(errors)})
    return model


def unlike_healthy(model: ScannerModel, healthy: Sequence[Observation]) -> Iterator[UnlikeHealthy]:
    """Yield the records that neither the model explains nor the other healthy records.

    Such a record raises the detection limit, and may hide what it is to show. The model is asked
    first: beside a spoiled record others seem wrong.
    """
    for name in (axis for axis in model.axes if model.axis(axis).model_discrepancies):
        driven, chain = _driven(healthy, name), chain_of(model.axis(name))
        for one in driven:
            others = with_healthy(model, [each for each in driven if each is not one])
            seen = [evidence_of(name, each, one) for each in dict.fromkeys((model, others))]
            if not any(Likelihood((each,), chain).fit(chain).adequate for each in seen):
                ratio = seen[0].ratio(chain)
                band = int(ratio.argmax())
                edges = seen[0].limit.edges[band : band + 2]
                yield UnlikeHealthy(name, one.name, float(ratio[band]), *edges)


def _driven(healthy: Sequence[Observation], axis: str) -> list[Observation]:
    return [one for one in healthy if axis in one.axes and np.ptp(one.drive.axis(axis))]


def _record(one: Observation, axis: str) -> AnyRecord:
    signals = AxisRecord(one.drive.axis(axis), one.displacement.axis(axis), one.sample_period)
    return AnyRecord(f"healthy: {one.name}", None, signals, one.depolarised)
