"""Parts of a signal with a motion that repeats, and between the motion's harmonics.

The part with the motion is, at each phase of the period, a slow course over the periods: the first
few cosines, and whatever is slower than half the rate of repetition. The part between the harmonics
is the rest. The parting is an orthogonal projection.
"""

import math
from functools import cached_property

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.fft import dct, idct, next_fast_len
from scipy.optimize import minimize_scalar

from afm_scan_ros.core.bands import fast_length
from afm_scan_ros.core.diagnosis.settings import PARTING, PartingSettings
from afm_scan_ros.core.types import Array


@frozen(slots=False)
class Repetition:
    """Samples from ``first`` to before ``last`` in which a motion repeats ``periods`` times."""

    first: int
    last: int
    periods: float
    settings: PartingSettings = PARTING

    @property
    def courses(self) -> int:
        """Cosines by which the part with the motion may change; 0 where the periods are few."""
        return min(self.settings.slow_courses, int(self.periods / self.settings.periods_each))

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.last - self.first

    def between(self, signals: Array) -> Array:
        """Coefficients (m, k) of the part between the harmonics, of signals (m, n)."""
        return self._between(signals[:, self.first : self.last])

    def part_between(self, signal: Array) -> Array:
        """Part between the harmonics of a signal (count,) that begins with the repetition."""
        return self.signal(self._between(signal[np.newaxis])[0])

    def _between(self, parts: Array) -> Array:
        found = self._changing(dct(parts, norm="ortho"))
        found[:, : self.below] = 0.0
        return found

    def _changing(self, coefficients: Array) -> Array:
        """Coefficients (m, k) without the slow courses of what repeats."""
        samples, length = self._period
        finer = np.zeros((len(coefficients), length))
        finer[:, : self.count] = coefficients
        repeated = _slow_courses(idct(finer, norm="ortho"), samples, self.courses)
        return np.asarray(coefficients - dct(repeated, norm="ortho")[:, : self.count])

    def signal(self, between: Array) -> Array:
        """Signal (count,) of the part between the harmonics, of its coefficients (k,)."""
        return np.asarray(idct(between, norm="ortho"))

    @property
    def below(self) -> int:
        """Number of coefficients below half the rate of repetition."""
        return int(self.periods)

    def clear(self, periods: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether frequencies, in periods in all, are between the harmonics, by some ``margin``."""
        turns = periods / self.periods
        apart = np.minimum(np.abs(turns - np.round(turns)), turns - 0.5)
        return np.asarray(
            apart * self.periods > 0.5 * self.courses + margin + self.settings.precision
        )

    def without_first(self) -> "Repetition":
        """Return that of the later periods, all but the first."""
        period = self.count / self.periods
        return self._within(self.first + round(period), self.last, period)

    def halved(self, count: int) -> "Repetition":
        """Return that of every other sample, of which there are ``count``."""
        last = min(self.last // 2, count)
        return self._within(-(-self.first // 2), last, 0.5 * self.count / self.periods)

    def _within(self, first: int, last: int, period: float) -> "Repetition":
        """Return that of a ``period`` in samples, of as many to ``last`` as transform fast."""
        count = fast_length(last - first)
        return evolve(self, first=first, last=first + count, periods=count / period)

    def refined(self, moved: Array) -> "Repetition":
        """Return the number of periods near this one that leaves least of a motion (n,) between."""
        near = self.settings.search
        found = minimize_scalar(
            lambda each: evolve(self, periods=each).share_between(moved),
            bounds=(self.periods - near, self.periods + near),
            method="bounded",
            options={"xatol": self.settings.precision},
        )
        both = self, evolve(self, periods=float(found.x))
        return min(both, key=lambda each: each.share_between(moved))

    def share_between(self, moved: Array) -> float:
        """Share of the mean square of a motion (n,) that does not repeat."""
        seen = moved[np.newaxis, self.first : self.last]
        if not self.courses or not np.ptp(seen):
            return 1.0
        power = np.sum(self._changing(dct(seen, norm="ortho")) ** 2)
        return float(power / np.var(seen) / self.count)

    @cached_property
    def _period(self) -> tuple[int, int]:
        """Samples of a period, and of all, at a rate with a whole number of both.

        It is the first that misses them by less than the precision and transforms fast, or else the
        one that misses least. It is at least that of the record, so no coefficient is lost.
        """
        least = max(math.ceil(self.count / self.periods), 1)
        tried = np.arange(least, max(int(self.settings.finer * least), least + 8) + 1)
        lengths = np.maximum(np.round(tried * self.periods).astype(int), self.count)
        misfit = np.abs(tried * self.periods - lengths) / tried
        fast = [next_fast_len(length) == length for length in lengths.tolist()]
        both = fast & (misfit <= self.settings.precision)
        place = both.argmax() if both.any() else misfit.argmin()
        return int(tried[place]), int(lengths[place])


def _slow_courses(signals: Array, samples: int, slow: int) -> Array:
    """Course over the periods of so many ``samples``, at each phase, of signals (m, n)."""
    length = signals.shape[1]
    whole, rest = divmod(length, samples)
    padded = np.zeros((len(signals), (whole + 1) * samples))
    padded[:, :length] = signals
    by_period = padded.reshape(len(signals), whole + 1, samples)
    for count, phases in ((whole + 1, slice(rest)), (whole, slice(rest, samples))):
        basis = idct(np.eye(slow, count), norm="ortho")
        seen = by_period[:, :count, phases]
        by_period[:, :count, phases] = basis.T @ (basis @ seen)
    return padded[:, :length]
