"""What limits a verdict, as values; SI units throughout."""

from collections.abc import Iterator, Mapping
from typing import TypeAlias

from attrs import frozen

from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.checks import single_rate_band
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.model import ScannerModel


@frozen
class SingleRate:
    """The model's discrepancy on an axis is known from motion in one band (Hz) alone."""

    axis: str
    low: float
    high: float


@frozen
class AboveDetectionLimit:
    """A record whose residual exceeds the detection limit in a band (Hz), without an effect.

    ``others`` says whether there are other records, which do not share it.
    """

    axis: str
    record: str
    ratio: float
    low: float
    high: float
    others: bool


Caution: TypeAlias = SingleRate | AboveDetectionLimit


def cautions(model: ScannerModel, by_axis: Mapping[str, AxisDiagnosis]) -> Iterator[Caution]:
    """Yield them axis by axis: a model known at one rate, a residual above its limit."""
    for axis, trace in by_axis.items():
        if band := single_rate_band(model.axis(axis).model_discrepancies):
            yield SingleRate(axis, *band)
        if trace.verdict == SUFFICIENT:
            yield from _above(axis, trace)


def _above(axis: str, trace: AxisDiagnosis) -> Iterator[Caution]:
    """Yield the record that exceeds its detection limit most, though chance may explain it."""
    left = zip(trace.evidence, trace.ratio_after, strict=True)
    evidence, ratio = max(left, key=lambda each: float(each[1].max()))
    band = int(ratio.argmax())
    if ratio[band] >= AT_LIMIT:
        low, high = evidence.floor.edges[band : band + 2]
        name, others = evidence.playback.view.name, len(trace.evidence) > 1
        yield AboveDetectionLimit(axis, name, float(ratio[band]), low, high, others)
