"""Cells of a record: bands of its coefficients, apart with the motion and between its harmonics.

What a model gets wrong about a motion that repeats, repeats with it, but for slow changes. So the
bands with the motion hold the model's error. In those between its harmonics sensor noise and
disturbances are nearly alone. The mean squares of the cells add up to that of the signal. Where the
motion does not repeat, all is with the motion.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from attrs import evolve, field, frozen
from scipy.fft import idct

from afm_scan_ros.core.bands import bounds, coefficients
from afm_scan_ros.core.diagnosis.repetition import Repetition
from afm_scan_ros.core.types import Array, floats


@frozen(eq=False, slots=False)
class RecordCells:
    """Cells of signals of ``count`` samples, in n bands between n + 1 ``edges`` (Hz).

    They are the bands with the motion, and then, where it repeats, those between its harmonics.
    """

    edges: tuple[float, ...] = field(converter=floats)
    count: int
    sample_period: float
    repetition: Repetition | None = None

    def repeating(
        self,
        drive: Array,
        rates: Sequence[float],
        within: tuple[int, int] | None = None,
        *,
        exact: bool = False,
    ) -> "RecordCells":
        """Return the cells where a drive (n,) repeats at one of some ``rates`` (Hz).

        It does ``within`` some samples, or in all. The rate found is refined where it is not
        ``exact``. The first period has what the approach leaves, so it is left out.
        """
        first, last = within or (0, self.count)
        duration = (last - first) * self.sample_period
        tried = [Repetition(first, last, rate * duration) for rate in rates if last > first]
        found = min(tried, key=lambda each: each.share_between(drive), default=None)
        if found and not exact:
            found = found.refined(drive)
        if found is None or found.share_between(drive) > found.settings.largest_share:
            return self
        later = found.without_first()
        return evolve(self, repetition=later if later.courses else None)

    @property
    def bands(self) -> int:
        """Number of bands."""
        return len(self.edges) - 1

    @cached_property
    def counts(self) -> Array:
        """Number of coefficients (cells,) of each; at least one."""
        every, of = np.diff(self.firsts[0]).astype(np.float64), self.repetition
        if of is None:
            return np.asarray(np.maximum(every, 1.0))
        faster = np.diff(np.maximum(self.firsts[1], of.below))
        between = faster * (1.0 - of.courses / of.periods)
        return np.asarray(np.maximum(np.concatenate((every - between, between)), 1.0))

    def between(self, signals: Array) -> Array:
        """Coefficients (m, l) of signals (m, n) between the harmonics, the last l of all."""
        if self.repetition is None:
            return np.empty((len(signals), 0))
        return self.repetition.between(signals) / math.sqrt(self.count)

    def along(self, signals: Array) -> Array:
        """Coefficients (m, k) of signals (m, n) that are all counted with the motion."""
        between = np.zeros((len(signals), self.size - self.count))
        return np.hstack((coefficients(signals), between))

    def coefficients(self, signal: Array, between: Array | None = None) -> Array:
        """Coefficients (k,) of a signal (n,), of which some (l,) are ``between`` the harmonics.

        These are those of the signal itself where none are given. Squares add to the mean square,
        the mean left out.
        """
        if between is None:
            between = self.between(signal[np.newaxis])[0]
        rest = signal - self._between_signal(between)
        return np.append(coefficients(rest[np.newaxis])[0], between)

    def _between_signal(self, between: Array) -> Array:
        """Signal (n,) of coefficients (l,) between the harmonics."""
        found = np.zeros(self.count)
        if (of := self.repetition) is not None and len(between):
            found[of.first : of.last] = of.signal(between * math.sqrt(self.count))
        return found

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.count + (self.repetition.count if self.repetition else 0)

    def signal(self, found: Array) -> Array:
        """Signal (n,) of coefficients (k,)."""
        along = idct(found[: self.count], norm="ortho") * math.sqrt(self.count)
        return np.asarray(along + self._between_signal(found[self.count :]))

    def products(self, one: Array, other: Array) -> Array:
        """Mean products (cells, m, l) of signals of coefficients (m, k) and (l, k)."""
        return np.array([one[:, part] @ other[:, part].T for part in self._parts])

    def power(self, found: Array) -> Array:
        """Mean square (cells,) of a signal of coefficients (k,)."""
        squares = found**2
        return np.array([squares[part].sum() for part in self._parts])

    def spread(self, values: Array) -> Array:
        """Values of the cells (cells,) for each of the coefficients."""
        return np.repeat(values, [part.stop - part.start for part in self._parts])

    @cached_property
    def firsts(self) -> list[tuple[int, ...]]:
        """First coefficients of the bands, of the whole and of what is between."""
        counts = [self.count, *([self.repetition.count] if self.repetition else [])]
        return [bounds(self.edges, count, self.sample_period) for count in counts]

    @cached_property
    def _parts(self) -> list[slice]:
        begun = zip((0, self.count), self.firsts, strict=False)
        return [slice(at + a, at + b) for at, each in begun for a, b in pairwise(each)]
