"""Whether a record is of the scanner that a model was identified on.

Models of which the error is known from motion at one rate alone.

At one rate the loops of a lag, a delay or viscous domains are those of a hysteresis that is wider:
one identified there has taken up of them what it can, and hides them or has them pass for another
effect. Motion at several rates tells (Mayergoyz, Mathematical Models of Hysteresis, 1991).

What limits a verdict, as values; SI units throughout.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from attrs import frozen
from numpy.polynomial.legendre import legfit, legval

from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.types import AXES, Array, Trace

VISIBLE, UNIT = 1e-7, 100.0
"""m rms of predicted motion, below which drift or noise may well be larger. Such a record
contradicts the model only if, its slow course left out, it moves along with it, and so many
times as far."""
SLOW_SHARE = 3
"""Degree of the polynomial that is a record's slow course."""
GAIN_RANGE = (0.5, 2.0)
LEAST_CORRELATION = 0.7
"""Correlation of predicted and measured motion, below which they are not of one axis."""


def refuse_mismatch(model: ScannerModel, observed: Observation) -> None:
    """Refuse a record that no fault of this scanner explains: another one's, or in other units.

    Raises InputError, which names the record, the axis and the mend; also where the drive leaves
    the range that the model was identified in.
    """
    try:
        predicted = _driven(model, observed.drive)
    except BeyondRangeError as error:
        raise InputError(
            f"{observed.name}: the drive is {error.value:.4g} V at sample {error.sample}, and the"
            f" model was identified to {error.limit:.4g} V: give a record of a smaller drive, or"
            " identify the model to a larger one"
        ) from error
    for axis in (name for name in model.axes if name in observed.axes):
        _refuse_unlike(
            f"{observed.name}: axis {axis}", predicted[axis], observed.displacement.axis(axis)
        )


def _driven(model: ScannerModel, drive: Trace) -> dict[str, Array]:
    """Displacement (n,) in m of each axis by the drive alone: an identified model creeps at 0 V."""
    still = Trace(0, drive.sample_period, np.zeros_like(drive.x), np.zeros_like(drive.y))
    moved, rest = predict(model, drive), predict(model, still)
    return {axis: moved.axis(axis) - rest.axis(axis) for axis in AXES}


def _refuse_unlike(where: str, predicted: Array, measured: Array) -> None:
    visible = float(predicted.std()) >= VISIBLE
    gain, likeness = _compared(predicted, measured, degree=0 if visible else SLOW_SHARE)
    if not visible and (abs(gain) < UNIT or abs(likeness) < LEAST_CORRELATION):
        return
    if not GAIN_RANGE[0] <= gain <= GAIN_RANGE[1]:
        raise InputError(
            f"{where} moves {gain:.3g} times as far as the model says: it is of another scanner"
            " or axis, or in another unit or sign; give the model of this scanner, drive in V"
            " and displacement in m"
        )
    if likeness < LEAST_CORRELATION:
        raise InputError(
            f"{where} moves unlike the model (correlation {likeness:.2f}): it is of another"
            " scanner or axis; give the model of this scanner"
        )


def _compared(predicted: Array, measured: Array, degree: int) -> tuple[float, float]:
    """Gain from predicted to measured motion and their correlation, slow courses left out."""
    time = np.linspace(-1.0, 1.0, len(predicted))
    expected, seen = (s - legval(time, legfit(time, s, degree)) for s in (predicted, measured))
    strength = max(float(expected @ expected), np.finfo(float).tiny)
    gain = float(expected @ seen) / strength
    return gain, gain * float(np.sqrt(strength / max(float(seen @ seen), np.finfo(float).tiny)))


LEAST_MOVED = 0.2
"""Share of a record's largest displacement in a band from which on the record moved in it: the
harmonics of a triangle, the largest of which has a ninth, are no further rate."""
SEVERAL_RATES = 10.0
"""Ratio of the highest to the lowest frequency of the motion that counts as several rates."""


def single_rate_band(known: Sequence[ModelDiscrepancy]) -> tuple[float, float] | None:
    """Band (Hz) of the only rate at which a model's error is known; None where it is of several.

    None too where nothing is known, or where what is known did not move.
    """
    moved = [band for record in known for band in _rates_moved(record)]
    if not moved:
        return None
    low, high = min(low for low, _ in moved), max(high for _, high in moved)
    return None if high >= SEVERAL_RATES * min(end for _, end in moved) else (low, high)


def _rates_moved(record: ModelDiscrepancy) -> list[tuple[float, float]]:
    """Bands (Hz) in which a record moved."""
    size = np.array(record.displacement)
    places = np.flatnonzero((size > 0.0) & (size >= LEAST_MOVED * size.max()))
    return [(record.bands[i], record.bands[i + 1]) for i in places]


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
