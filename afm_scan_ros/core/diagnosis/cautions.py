"""Checks that a record belongs to the model's scanner, and states limitations of a verdict.

Records at a single rate limit a verdict: there, a lag, a delay or rate-dependent hysteresis widens
the loop like static hysteresis does. A hysteresis identified at one rate may contain such effects.
Motion at several rates separates them (Mayergoyz, Mathematical Models of Hysteresis, 1991).
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from attrs import evolve, frozen
from numpy.polynomial.legendre import legfit, legval
from scipy.signal import correlate

from afm_scan_ros.core.bands import weighted
from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.discrepancy import MotionByBand, places_moved, tested_motion
from afm_scan_ros.core.diagnosis.likelihood import Likelihood
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.settings import LIMIT, MISMATCH
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.scale import length_scale
from afm_scan_ros.core.effects.vibration import VibrationModel, first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.validation import validate_from
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of, predict
from afm_scan_ros.core.types import AXES, Array, Trace


def refuse_mismatch(model: ScannerModel, observed: Record) -> None:
    """Refuse a record that is of another scanner or axis, or in other units.

    Raises InputError, which names the record, the axis and the fix; also where the drive leaves
    the range that the model was identified in.
    """
    try:
        predicted = _driven(model, observed.traces()[0])
    except BeyondRangeError as error:
        raise InputError(
            f"{observed.name}: the drive is {error.value:.4g} V at sample {error.sample}, and the"
            f" model was identified to {error.limit:.4g} V: give a record of a smaller drive, or"
            " identify the model to a larger one"
        ) from error
    for axis in (name for name in model.axes if name in observed.axes):
        drive, measured = observed.signals(axis)
        slow = _below_resonance(model.axis(axis).vibration, observed.sample_period, len(measured))
        signals = predicted[axis], measured
        if slow is not None:
            moved = weighted(predicted[axis], slow)
            if float(moved.std()) >= MISMATCH.least_slow * float(predicted[axis].std()):
                signals = moved, weighted(measured, slow)
        visible = MISMATCH.visible * length_scale(model.axis(axis))
        _refuse_unlike(f"{observed.name}: axis {axis}", *signals, visible)
        if float(signals[0].std()) >= visible:
            _refuse_backward(f"{observed.name}: axis {axis}", drive, *signals)


def _below_resonance(stage: VibrationModel, period: float, count: int) -> Array | None:
    """Weights (n,) of the coefficients well below the first resonance; None where there is none.

    A resonance that moved changes the motion about it by far more than half.
    """
    try:
        highest = MISMATCH.slow * first_resonance(stage).frequency
    except InputError:
        return None
    return np.asarray(np.arange(count) / (2.0 * count * period) < highest, dtype=np.float64)


def _driven(model: ScannerModel, drive: Trace) -> dict[str, Array]:
    """Displacement (n,) in m of each axis due to the drive, without the model's creep at rest."""
    at_rest = {axis: np.full_like(drive.axis(axis), _rest(model, axis)) for axis in AXES}
    still = Trace(0, drive.sample_period, **at_rest)
    moved, rest = predict(model, drive), predict(model, still)
    return {axis: moved.axis(axis) - rest.axis(axis) for axis in AXES}


def _rest(model: ScannerModel, axis: str) -> float:
    """Drive (V) at which a scanner rests: 0 V, or the nearest that was identified."""
    if axis not in model.axes:
        return 0.0
    return float(np.clip(0.0, *model.axis(axis).hysteresis.forward.drive_range))


def _refuse_unlike(where: str, predicted: Array, measured: Array, least: float) -> None:
    visible = float(predicted.std()) >= least
    gain, likeness = _compared(predicted, measured, degree=0 if visible else MISMATCH.slow_degree)
    if not visible and (abs(gain) < MISMATCH.unit or abs(likeness) < MISMATCH.least_correlation):
        return
    least_gain, largest_gain = 1.0 / MISMATCH.gain_factor, MISMATCH.gain_factor
    other_shape = visible and measured.any() and abs(likeness) < MISMATCH.same_shape
    if gain > largest_gain or (gain < least_gain and not other_shape):
        raise InputError(
            f"{where} moves {gain:.3g} times as far as the model says: it is of another scanner"
            " or axis, or in another unit or sign; give the model of this scanner, drive in V"
            " and displacement in m"
        )
    delayed = _largest_correlation(predicted, measured) if other_shape else likeness
    if delayed < MISMATCH.least_correlation:
        raise InputError(
            f"{where} moves unlike the model (correlation {delayed:.2f} at best): it is of another"
            " scanner or axis; give the model of this scanner"
        )


def _refuse_backward(where: str, drive: Array, predicted: Array, measured: Array) -> None:
    """Refuse motion that is ahead of its drive, where the prediction is behind: it gives energy."""
    lost, found = (_lost(drive[: len(moved)], moved) for moved in (predicted, measured))
    if lost > MISMATCH.least_loop and found < -MISMATCH.backward * lost:
        raise InputError(
            f"{where} goes round its loops backward: its drive and displacement columns are"
            " exchanged; name them the other way round"
        )


def _lost(drive: Array, moved: Array) -> float:
    """Area of the loops of a motion (n,) under a drive (n,), of the rectangle that holds them."""
    rectangle = float(np.ptp(drive) * np.ptp(moved))
    area = -float((moved - moved.mean()) @ np.gradient(drive))
    return area / max(rectangle, np.finfo(float).tiny)


def _largest_correlation(predicted: Array, measured: Array) -> float:
    """Largest correlation of two motions (n,) over all delays of one against the other."""
    one, other = (signal - signal.mean() for signal in (predicted, measured))
    largest = float(correlate(other, one, method="fft").max())
    return largest / max(float(np.linalg.norm(one) * np.linalg.norm(other)), np.finfo(float).tiny)


def _compared(predicted: Array, measured: Array, degree: int) -> tuple[float, float]:
    """Gain from predicted to measured motion and their correlation, slow trends removed."""
    time = np.linspace(-1.0, 1.0, len(predicted))
    expected, seen = (s - legval(time, legfit(time, s, degree)) for s in (predicted, measured))
    strength = max(float(expected @ expected), np.finfo(float).tiny)
    gain = float(expected @ seen) / strength
    return gain, gain * float(np.sqrt(strength / max(float(seen @ seen), np.finfo(float).tiny)))


def single_rate_band(known: Sequence[ModelDiscrepancy]) -> tuple[float, float] | None:
    """Band (Hz) of the only rate at which a model's error is known.

    None where it is known at several rates, or from no motion at all.
    """
    moved = [band for record in known for band in _rates_moved(record)]
    if not moved:
        return None
    low, high = min(low for low, _ in moved), max(high for _, high in moved)
    return None if high >= MISMATCH.several_rates * min(end for _, end in moved) else (low, high)


def _rates_moved(record: ModelDiscrepancy) -> list[tuple[float, float]]:
    """Bands (Hz) in which a record moved."""
    places = places_moved(np.array(record.displacement))
    return [(record.bands[i], record.bands[i + 1]) for i in places]


@frozen
class SingleRate:
    """The model discrepancy of an axis is known from motion in one band (Hz) only."""

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


@frozen
class UntestedMotion:
    """A record of a ``motion`` at which the model's error is not known, only at that ``tested``."""

    axis: str
    record: str
    motion: MotionByBand
    tested: MotionByBand | None


@frozen
class UnlikeHealthy:
    """A record called healthy that exceeds the model's limit in a band (Hz), and the others'."""

    axis: str
    record: str
    ratio: float
    low: float
    high: float


Caution: TypeAlias = SingleRate | AboveDetectionLimit | UntestedMotion | UnlikeHealthy


def cautions(model: ScannerModel, by_axis: Mapping[str, AxisDiagnosis]) -> Iterator[Caution]:
    """Yield the limitations axis by axis: motion, a single rate, a residual above its limit."""
    for axis, diagnosed in by_axis.items():
        tested = tested_motion(model.axis(axis).model_discrepancies)
        for each in diagnosed.evidence:
            if each.untested:
                yield UntestedMotion(axis, each.playback.view.name, each.untested, tested)
        if band := single_rate_band(model.axis(axis).model_discrepancies):
            yield SingleRate(axis, *band)
        if diagnosed.verdict == SUFFICIENT:
            yield from _above(axis, diagnosed)


def _above(axis: str, diagnosed: AxisDiagnosis) -> Iterator[Caution]:
    """Yield the record that exceeds its detection limit most, though chance may explain it."""
    left = zip(diagnosed.evidence, diagnosed.ratio_after, strict=True)
    evidence, ratio = max(left, key=lambda each: float(each[1].max()))
    band = int(ratio.argmax())
    if ratio[band] >= LIMIT.expected:
        low, high = evidence.limit.edges[band : band + 2]
        name, others = evidence.playback.view.name, len(diagnosed.evidence) > 1
        yield AboveDetectionLimit(axis, name, float(ratio[band]), low, high, others)


def with_healthy(model: ScannerModel, healthy: Sequence[Record]) -> ScannerModel:
    """Return the model with its errors on ordinary records, of the axes that they drive.

    Raises InputError where a drive leaves the identified range.
    """
    for name in model.axes:
        axis = model.axis(name)
        errors = [_error(axis, one, name) for one in _driving(healthy, name)]
        model = evolve(model, **{name: axis.also_known(errors)})
    return model


def unlike_healthy(model: ScannerModel, healthy: Sequence[Record]) -> Iterator[UnlikeHealthy]:
    """Yield the records that neither the model explains nor the other healthy records.

    Such a record raises the detection limit, and may hide what it is to show. The model is asked
    first: beside a spoiled record others seem wrong.
    """
    for name in (axis for axis in model.axes if model.axis(axis).model_discrepancies):
        driven, chain = _driving(healthy, name), chain_of(model.axis(name))
        for one in driven:
            others = with_healthy(model, [each for each in driven if each is not one])
            seen = [evidence_of(name, each, one) for each in dict.fromkeys((model, others))]
            if not any(Likelihood((each,), chain).fit(chain).adequate for each in seen):
                ratio = seen[0].ratio(chain)
                band = int(ratio.argmax())
                edges = seen[0].limit.edges[band : band + 2]
                yield UnlikeHealthy(name, one.name, float(ratio[band]), *edges)


def _driving(healthy: Sequence[Record], axis: str) -> list[Record]:
    return [one for one in healthy if axis in one.axes and np.ptp(one.signals(axis)[0])]


def _error(model: AxisModel, one: Record, axis: str) -> ModelDiscrepancy:
    """Return the error on a whole record, that of an initial state not known among it."""
    record = evolve(one.axis(axis), name=f"healthy: {one.name}")
    return validate_from(model, record, 0).model_discrepancy
