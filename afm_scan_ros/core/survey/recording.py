"""What a survey keeps of one recording."""

import math
from collections.abc import Iterator

from attrs import frozen

from afm_scan_ros.core.diagnosis.fit import CONFIDENT

Interval = tuple[float, float]


@frozen
class Estimate:
    """A positive quantity of an axis, with the standard deviations of its logarithm.

    ``value`` is dimensionless: a factor on a parameter of the model, or a ratio. ``noise`` is the
    deviation by the sensor's noise alone, ``model_error`` that by the model's error, None where
    the value is no parameter.
    """

    name: str
    value: float
    noise: float
    model_error: float | None = None

    @property
    def interval(self) -> Interval:
        """95 % interval by noise and model error."""
        factor = math.exp(CONFIDENT * math.hypot(self.noise, self.model_error or 0.0))
        return self.value / factor, self.value * factor


@frozen
class EffectValue:
    """A parameter of an effect, in ``unit``; the 95 % interval is None where it is not known."""

    name: str
    unit: str
    value: float
    low: float | None = None
    high: float | None = None


@frozen
class NamedEffect:
    """An effect that a diagnosis named on an ``axis``, "x", "y" or "both"."""

    name: str
    kind: str
    axis: str
    probability: float
    values: tuple[EffectValue, ...]


@frozen
class SurveyedAxis:
    """Detection limit and residual of an axis, rms in m, and what its recording tells of it."""

    axis: str
    detection_limit: float
    residual: float
    estimates: tuple[Estimate, ...]


@frozen(kw_only=True)
class Recording:
    """One recording of an instrument, diagnosed, or the ``error`` why it could not be.

    ``recorded`` is the time of its first sample in ns since the epoch, 0 where it is not stated.
    Recordings of one ``motion`` follow the same path, so the model errs alike in them.
    ``model`` and ``version`` are the model's SHA-256 and the version of this package, ``identity``
    is a digest of the bag's files.
    """

    bag: str
    instrument: str
    identity: str
    model: str
    version: str
    recorded: int = 0
    scan_id: str = ""
    motion: str = ""
    samples: int = 0
    sample_rate: float = 0.0
    verdict: str = ""
    axes: tuple[SurveyedAxis, ...] = ()
    effects: tuple[NamedEffect, ...] = ()
    shortcomings: tuple[str, ...] = ()
    error: str = ""

    def estimates(self) -> Iterator[tuple[tuple[str, str], Estimate]]:
        """Yield each estimate with its axis and name."""
        for each in self.axes:
            for estimate in each.estimates:
                yield (each.axis, estimate.name), estimate
