"""What an identification finds wrong with a record or a fit, as values; SI units throughout.

``afm_scan_ros.report.fit_page`` words each finding and what to record instead.
"""

from attrs import frozen


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
    """Records that tell a scan over the whole drive to a ``share`` of its range only."""

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
