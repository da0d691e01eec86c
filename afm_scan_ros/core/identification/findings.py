"""What an identification finds wrong with a record or a fit, as values; SI units throughout.

``afm_scan_ros.report.fit_summary`` words each finding and what to record instead.
"""

from collections.abc import Iterable
from enum import Enum

from attrs import frozen

from afm_scan_ros.core.identification.records.hum import HumLine

Interval = tuple[float, float]


class MisfitCause(Enum):
    """What most of a misfit to a frequency response is due to."""

    MODES = "modes"
    NOISE = "noise"
    NONLINEARITY = "nonlinearity"


class Finding:
    """Something that a user should know before trusting a model."""


@frozen
class NegativeCreepGain(Finding):
    """A creep element whose gain has the wrong sign."""

    element: int
    time_constant: float


@frozen
class UndeterminedCreepElement(Finding):
    """A creep element that the record does not determine; ``hold`` is its longest rest, s."""

    element: int
    gain: float
    gain_interval: Interval
    time_constant: float
    time_constant_interval: Interval
    hold: float


@frozen
class CreepBeyondNoise(Finding):
    """The held-out error of the creep, sigma, exceeds the record's noise; both m."""

    sigma: float
    noise: float


@frozen
class ShortHold(Finding):
    """A hold (s) too short to separate elements slower than ``slowest`` (s)."""

    hold: float
    slowest: float
    needed: float


@frozen
class SlowStep(Finding):
    """A step of ``duration`` s, in which hysteresis hides a share of the fastest element."""

    duration: float
    hidden: float


@frozen
class AmplitudeDependentResponse(Finding):
    """The small-signal response changes with amplitude by a share beyond the noise's."""

    nonlinearity: float
    noise: float


@frozen
class DistortedSweep(Finding):
    """A sweep with a third ``harmonic``, over its fundamental: its gain is larger by ``gain``."""

    harmonic: float
    gain: float


@frozen
class LowCoherence(Finding):
    """Coherence below ``limit`` from ``frequency`` (Hz) on."""

    frequency: float
    limit: float


@frozen
class NarrowBand(Finding):
    """A band (Hz) that should reach from ``needed[0]`` to ``needed[1]`` for the resonance (Hz)."""

    band: Interval
    resonance: float
    needed: Interval


@frozen
class CoarseLines(Finding):
    """Lines ``spacing`` Hz apart across a resonance ``width`` Hz wide."""

    spacing: float
    width: float


@frozen
class UnmodelledDelay(Finding):
    """A frequency record that lags the model by ``delay`` s, or leads where it is negative."""

    delay: float
    interval: Interval


@frozen
class ResponseMisfit(Finding):
    """The vibration model differs from the response by a relative rms over a band (Hz)."""

    misfit: float
    band: Interval
    cause: MisfitCause
    share: float


@frozen
class GainMismatch(Finding):
    """The frequency record's gain over the hysteresis record's."""

    ratio: float


@frozen
class InexactInverse(Finding):
    """Errors of the exact inverse on held-out loops, over the drive's range."""

    sigma: float
    maximum: float


@frozen
class InexactDirectInverse(Finding):
    """Errors (V) of the direct inverse on held-out loops, and the paper's over 8 V."""

    sigma: float
    maximum: float
    paper_sigma: float
    paper_maximum: float


@frozen
class OpenLoops(Finding):
    """Difference (V) of the effective input among the returns to saturation."""

    difference: float


@frozen
class UnfinishedRecord(Finding):
    """A record whose drive (V) does not end where it began."""

    record: str
    first: float
    last: float


@frozen
class CreepGainMismatch(Finding):
    """The creep record's motion over the predicted one, at most at ``drive`` V."""

    ratio: float
    drive: float


@frozen
class SingleWave(Finding):
    """A frequency record with one draw of the phases alone."""


@frozen
class Hum(Finding):
    """Sines in a record, whatever its drive does: each frequency (Hz) with its amplitude (m)."""

    record: str
    lines: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, record: str, lines: Iterable[HumLine]) -> "Hum":
        """Take the lines found in a record."""
        return cls(record, tuple((line.frequency, line.amplitude) for line in lines))


@frozen
class SaturatedRecord(Finding):
    """A record that falls short by a share of its range at one end; ``drive`` is V peak to peak."""

    record: str
    end: str
    share: float
    drive: float


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
    """A record whose displacement follows a step of its drive within that sample."""

    record: str


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
