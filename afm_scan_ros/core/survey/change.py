"""Whether and when a series of estimates changed: a likelihood-ratio test of one change point.

The values are logarithms. Before the change they have one mean, and from it on another. Two tests
compare the means, for each place of the change:

- **Own scatter.** Recordings of one motion share the model's error, so it is subtracted: each
  motion has a mean of its own. The difference is fitted by least squares, weighted by the sensor's
  noise. The scatter about it scales the noise, but never below 1. Student's t distribution has as
  many degrees of freedom as the scatter is estimated from.
- **Detection limit.** Also where the motion differs, the difference must exceed the model's error
  on either side. It does not shrink with the number of recordings. Student's t distribution has
  the freedom from which the model's error is known.

The least probability over the places and both tests counts, times their number (Bonferroni). So
the probability of a false change in a series is at most that. K. J. Worsley, J. Am. Stat. Assoc.
74 (1979) 365, has the exact distribution of the first maximum for one motion.

The credible set of the place has a uniform prior (A. F. M. Smith, Biometrika 62 (1975) 407).
"""

from collections.abc import Hashable, Sequence

import numpy as np
import scipy
from attrs import frozen

from afm_scan_ros.core.diagnosis.axis_diagnosis import CERTAIN
from afm_scan_ros.core.diagnosis.fit import CONFIDENT
from afm_scan_ros.core.diagnosis.likelihood import KNOWN_FREEDOM
from afm_scan_ros.core.types import Array

TESTS = 2
FINEST = float(np.finfo(float).eps)
"""Noise of a logarithm of a sensor without any: what its computation rounds."""


@frozen(eq=False)
class Series:
    """Estimates in the order of time: logarithms and their deviations (n,), and the motions.

    The model's error is infinite where the values are no parameters.
    """

    values: Array
    noise: Array
    model_error: Array
    motions: Sequence[Hashable]


@frozen
class ChangePoint:
    """A possible change: the first recording after it, and the places ``earliest`` to ``latest``.

    ``probability`` is that of a larger test statistic in a series without a change. ``step`` is the
    difference of the logarithms, with its 95 % ``halfwidth``.
    """

    probability: float
    place: int
    earliest: int
    latest: int
    step: float
    halfwidth: float


@frozen(eq=False)
class _Test:
    """Step, its standard deviation (n - 1,) at each place, and the degrees of freedom."""

    step: Array
    deviation: Array
    freedom: float

    @property
    def _statistic(self) -> Array:
        return np.abs(self.step) / self.deviation

    @property
    def least(self) -> float:
        """Least probability, over the places, of a larger statistic."""
        return float(2.0 * scipy.stats.t.sf(self._statistic.max(), self.freedom))

    def at(self, probability: float) -> ChangePoint:
        """Describe the likeliest place, with those that are credible."""
        gain = np.log1p(self._statistic**2 / self.freedom)
        known = np.isfinite(self.deviation)
        logs = np.log(np.where(known, self.deviation, 1.0)) + 0.5 * self.freedom * gain
        share = scipy.special.softmax(np.where(known, logs, -np.inf))
        ranked = np.argsort(-share)
        held = ranked[: 1 + int(np.searchsorted(np.cumsum(share[ranked]), CERTAIN))]
        best = int(ranked[0])
        half = CONFIDENT * float(self.deviation[best])
        places = best + 1, int(held.min()) + 1, int(held.max()) + 1
        return ChangePoint(probability, *places, float(self.step[best]), half)


def change_point(series: Series) -> ChangePoint | None:
    """Return the likeliest change of a series; None where no test can tell one."""
    count = len(series.values)
    if count < 2:  # noqa: PLR2004 - one before and one after
        return None
    weight = np.maximum(series.noise, FINEST) ** -2.0
    scatter, scale = _by_scatter(series, weight)
    tests = [scatter] if scatter.freedom > 0 and np.isfinite(scatter.deviation).any() else []
    if np.isfinite(series.model_error).all():
        tests.append(_by_limit(series, weight, scale))
    if not tests:
        return None
    best = min(tests, key=lambda test: test.least)
    return best.at(min(1.0, TESTS * (count - 1) * best.least))


def _by_scatter(series: Series, weight: Array) -> tuple[_Test, Array]:
    """Compare recordings of the same motion; return the scale (n - 1,) of their noise too.

    The test has no freedom where no motion tells its scatter.
    """
    motions = list(dict.fromkeys(series.motions))
    member = np.array([[own == one for one in motions] for own in series.motions], dtype=float)
    total = weight @ member
    centred = series.values - member @ ((weight * series.values) @ member / total)
    # With weights v before and w after, and the sum s of weighted values before, the means of a
    # motion differ by -s (1 / v + 1 / w), and this difference has the information v w / (v + w).
    before = np.cumsum(weight[:, np.newaxis] * member, axis=0)[:-1]
    information = np.sum(before * (total - before) / total, axis=1)
    compared = information > 0.0
    information = np.where(compared, information, 1.0)
    step = np.where(compared, -np.cumsum(weight * centred)[:-1] / information, 0.0)
    freedom = len(weight) - len(motions) - 1
    scatter = np.sum(weight * centred**2) - step**2 * information
    scale = np.maximum(scatter / max(freedom, 1), 1.0)
    deviation = np.where(compared, np.sqrt(scale / information), np.inf)
    return _Test(step, deviation, freedom), scale


def _by_limit(series: Series, weight: Array, scale: Array) -> _Test:
    """Compare all recordings before with all after, the model's error not averaged."""
    parts = weight, weight * series.values, weight * series.model_error**2
    sums = np.cumsum(parts, axis=1)
    before, after = sums[:, :-1], sums[:, -1:] - sums[:, :-1]
    step = after[1] / after[0] - before[1] / before[0]
    variance = sum((scale + each[2]) / each[0] for each in (before, after))
    return _Test(step, np.sqrt(variance), KNOWN_FREEDOM)
