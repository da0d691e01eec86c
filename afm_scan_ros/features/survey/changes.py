"""Which instruments of a survey changed, what of them, and when.

A series of estimates has one change point, if any, found by a likelihood-ratio test.
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

from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Iterator, Sequence
from itertools import groupby
from math import inf

import numpy as np
import scipy
from attrs import evolve, frozen

from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND
from afm_scan_ros.core.diagnosis.settings import SEARCH, VARIANCE
from afm_scan_ros.core.model import CONFIDENT
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.survey.recording import QuantityEstimate, Recording

TESTS = 2
FINEST = float(np.finfo(float).eps)
"""Noise of a logarithm of a sensor without any: what its computation rounds."""
Course = list[tuple[Recording, QuantityEstimate]]
"""A series: each recording, in the order of time, with its estimate."""


@frozen(eq=False)
class EstimateSeries:
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
        held = ranked[: 1 + int(np.searchsorted(np.cumsum(share[ranked]), SEARCH.certain))]
        best = int(ranked[0])
        half = CONFIDENT * float(self.deviation[best])
        places = best + 1, int(held.min()) + 1, int(held.max()) + 1
        return ChangePoint(probability, *places, float(self.step[best]), half)


def change_point(series: EstimateSeries) -> ChangePoint | None:
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


def _by_scatter(series: EstimateSeries, weight: Array) -> tuple[_Test, Array]:
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


def _by_limit(series: EstimateSeries, weight: Array, scale: Array) -> _Test:
    """Compare all recordings before with all after, the model's error not averaged."""
    parts = weight, weight * series.values, weight * series.model_error**2
    sums = np.cumsum(parts, axis=1)
    before, after = sums[:, :-1], sums[:, -1:] - sums[:, :-1]
    step = after[1] / after[0] - before[1] / before[0]
    variance = sum((scale + each[2]) / each[0] for each in (before, after))
    return _Test(step, np.sqrt(variance), VARIANCE.known)


@frozen
class Change:
    """A quantity of an instrument that changed between two times, in ns since the epoch.

    ``point`` has its probability over all series (Bonferroni). ``effects`` are named by the
    diagnosis of most recordings after the change, and of at most half of those before.
    """

    instrument: str
    axis: str
    name: str
    point: ChangePoint
    after: int
    before: int
    effects: tuple[str, ...]


def usable(recordings: Iterable[Recording]) -> list[Recording]:
    """Return the recordings of an instrument that its trends are of, in the order of time.

    They are diagnosed, state a time, and have the model and version of the last of them. A scan
    counts once, however many bags hold it.
    """
    found = [each for each in recordings if not each.error and each.recorded]
    ranked = sorted(found, key=lambda each: each.recorded)
    once = {(each.recorded, each.scan_id): each for each in ranked}.values()
    last = ranked[-1:]
    return [e for e in once if any((e.model, e.version) == (o.model, o.version) for o in last)]


def by_instrument(recordings: Iterable[Recording]) -> Iterator[tuple[str, list[Recording]]]:
    """Yield each instrument, in the order of the names, with its recordings."""
    ranked = sorted(recordings, key=lambda each: each.instrument)
    for name, some in groupby(ranked, key=lambda each: each.instrument):
        yield name, list(some)


def courses(recordings: Iterable[Recording]) -> dict[tuple[str, str], Course]:
    """Return the series of an instrument by axis and name."""
    found: dict[tuple[str, str], Course] = defaultdict(list)
    for recording in usable(recordings):
        for key, estimate in recording.estimates():
            found[key].append((recording, estimate))
    return found


def changes(recordings: Sequence[Recording], false_alarm: float) -> list[Change]:
    """Return what changed, the surest first of each instrument.

    ``false_alarm`` is the probability, at most, of any change where no instrument changed.
    """
    tested = [
        (name, key, course, point)
        for name, some in by_instrument(recordings)
        for key, course in courses(some).items()
        if (point := change_point(_series(course)))
    ]
    found = [
        _change(name, key, course, evolve(point, probability=len(tested) * point.probability))
        for name, key, course, point in tested
        if len(tested) * point.probability <= false_alarm
    ]
    return sorted(found, key=lambda each: (each.instrument, each.point.probability))


def _series(course: Course) -> EstimateSeries:
    estimates = [estimate for _, estimate in course]
    return EstimateSeries(
        np.log([each.value for each in estimates]),
        np.array([each.noise for each in estimates]),
        np.array([inf if e.model_error is None else e.model_error for e in estimates]),
        [recording.motion for recording, _ in course],
    )


def _change(name: str, key: tuple[str, str], course: Course, point: ChangePoint) -> Change:
    recordings = [recording for recording, _ in course]
    last, first = recordings[point.earliest - 1], recordings[point.latest]
    effects = _effects(recordings[: point.earliest], recordings[point.latest :], key[0])
    return Change(name, *key, point, last.recorded, first.recorded, effects)


def _effects(before: Sequence[Recording], after: Sequence[Recording], axis: str) -> tuple[str, ...]:
    """Effects of an axis that most recordings ``after`` name, and at most half ``before``."""
    counts = [
        Counter(
            name
            for each in some
            if each.verdict == FOUND
            for name in {e.name for e in each.effects if e.axis in (axis, "both")}
        )
        for some in (before, after)
    ]
    earlier, later = counts
    return tuple(
        sorted(n for n in later if 2 * later[n] > len(after) and 2 * earlier[n] <= len(before))
    )
