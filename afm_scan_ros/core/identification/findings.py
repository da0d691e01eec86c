"""What an identification finds wrong with a record or a fit, as values; SI units throughout.

``afm_scan_ros.report.fit_page`` words each finding and what to record instead.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.tones import tone_amplitudes
from afm_scan_ros.core.identification.validation import PREDICTED, Validation
from afm_scan_ros.core.record import Record


class Finding:
    """Something that a user should know before trusting a model."""


@frozen
class Hum(Finding):
    """Sines in a record, whatever its drive does: each frequency (Hz) with its amplitude (m)."""

    record: str
    lines: tuple[tuple[float, float], ...]


@frozen
class ValidationMismatch(Finding):
    """The share of a validation record's motion that the model does not predict."""

    record: str
    share: float


@frozen
class NotValidated(Finding):
    """All records were fitted; none is held out, so that the model's error is not known."""


@frozen
class NotConverged(Finding):
    """A fit whose likelihood may still grow by ``remaining`` nat."""

    remaining: float


@frozen
class ReadAfterUpdate(Finding):
    """A record read after each update of its drive; whether the model predicts what is read so."""

    record: str
    predicted: bool


@frozen
class UncertainScan(Finding):
    """Records that tell scans of some size to a ``share`` of their range only."""

    share: float


@frozen
class UnknownStart(Finding):
    """A record whose initial memory is unknown, so that its first ``seconds`` are not fitted."""

    record: str
    seconds: float


@frozen
class SensorLowPass(Finding):
    """A sensor that reads through a low-pass of an ``order`` and a ``corner`` (Hz)."""

    order: int
    corner: float


@frozen
class LateReading(Finding):
    """A displacement that is read later than the drive is written, by a ``delay`` (s)."""

    delay: float


def findings_of(
    fit: AxisFit, deviation: float, held_out: Sequence[tuple[Record, Validation]]
) -> Iterator[Finding]:
    """Yield what a user should know of the records and of the fit before trusting the model.

    ``deviation`` is the standard deviation of a predicted scan over its range, of the worst size.
    """
    yield from _of_records(fit)
    if sensor := fit.layout.sensor_of(fit.theta):
        if sensor.corner is not None:
            yield SensorLowPass(sensor.order, sensor.corner)
        if sensor.delay:
            yield LateReading(sensor.delay)
    if not fit.converged:
        yield NotConverged(fit.remaining)
    if deviation > fit.layout.settings.poor:
        yield UncertainScan(deviation)
    if not held_out:
        yield NotValidated()
    for given, result in held_out:
        moved = float(np.std(given.displacement))
        share = float(np.linalg.norm(result.model_discrepancy.rms)) / moved
        if share > PREDICTED:
            yield ValidationMismatch(given.name, share)


def _of_records(fit: AxisFit) -> Iterator[Finding]:
    """Yield tones that are larger than the model's error, as smaller ones may be a part of it."""
    for record, tones in zip(fit.records, tone_amplitudes(fit), strict=True):
        error = fit.discrepancy * record.motion
        if large := tuple((tone, size) for tone, size in tones if size > error):
            yield Hum(record.name, large)
    for record in fit.records:
        if record.first:
            yield UnknownStart(record.name, record.first * record.period)
