"""Two ways of doing a thing, measured by turns in one run: what slows the machine slows both."""

from collections.abc import Callable, Sequence
from time import perf_counter, process_time

import numpy as np

from afm_scan_ros.report.table import Row

COLUMNS = {
    "what": ("what", ""),
    "against": ("measured against", ""),
    "ours": ("ours", ".4g"),
    "theirs": ("that", ".4g"),
    "unit": ("unit", ""),
    "ratio": ("ratio", ".2f"),
    "lowest": ("lowest", ".2f"),
    "highest": ("highest", ".2f"),
    "target": ("target", ""),
}
"""Medians over the turns; the ratio is the median of each turn's own."""


def by_turns(turns: int, *measures: Callable[[], float]) -> Sequence[Sequence[float]]:
    """Return what each measure gave in each turn, after one that does not count."""
    for measure in measures:
        measure()
    given = [[measure() for measure in measures] for _ in range(turns)]
    return list(zip(*given, strict=True))


def seconds(task: Callable[[], object]) -> Callable[[], float]:
    """Return the measure of how long a task takes, s."""
    return _timed(task, perf_counter)


def processor_seconds(task: Callable[[], object]) -> Callable[[], float]:
    """Return the measure of the processor time that a task takes, s."""
    return _timed(task, process_time)


def _timed(task: Callable[[], object], clock: Callable[[], float]) -> Callable[[], float]:
    def measure() -> float:
        start = clock()
        task()
        return clock() - start

    return measure


def row(
    what: str,
    against: str,
    unit: str,
    target: str,
    ours: Sequence[float],
    theirs: Sequence[float],
) -> Row:
    """Return the row of a ratio, ours over theirs."""
    ratios = np.divide(ours, theirs)
    return {
        "what": what,
        "against": against,
        "ours": float(np.median(ours)),
        "theirs": float(np.median(theirs)),
        "unit": unit,
        "ratio": float(np.median(ratios)),
        "lowest": float(ratios.min()),
        "highest": float(ratios.max()),
        "target": target,
    }
