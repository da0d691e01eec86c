"""Which instruments of a survey changed, what of them, and when."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from math import inf

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND
from afm_scan_ros.core.survey.change import ChangePoint, Series, change_point
from afm_scan_ros.core.survey.recording import Estimate, Recording

Course = list[tuple[Recording, Estimate]]
"""A series: each recording, in the order of time, with its estimate."""


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


def _series(course: Course) -> Series:
    estimates = [estimate for _, estimate in course]
    return Series(
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
