"""Two ways of doing a thing, timed turn by turn in one run: what slows the machine slows both."""

from collections.abc import Callable
from time import perf_counter

import numpy as np
from attrs import frozen

from afm_scan_ros.bench.table import Row

COLUMNS = {
    "what": ("what", ""),
    "against": ("measured against", ""),
    "samples": ("samples", ",d"),
    "ns_per_sample": ("ns a sample", ".1f"),
    "ratio": ("ratio", ".3g"),
    "lowest": ("lowest", ".3g"),
    "highest": ("highest", ".3g"),
    "target": ("target", ""),
}
"""Of a table of races: the ratio is the median over the turns, beside the lowest and highest."""


@frozen
class Task:
    """What is timed, and how many ``samples`` it goes through."""

    run: Callable[[], object]
    samples: int

    def seconds(self) -> float:
        """Seconds a sample takes."""
        start = perf_counter()
        self.run()
        return (perf_counter() - start) / self.samples


def race(what: str, ours: Task, against: str, theirs: Task, target: str, turns: int) -> Row:
    """Return the row of a race: our seconds a sample over theirs, each turn by itself.

    A target of so many times as fast (``≥``) has their seconds over ours. The first use of either,
    which may compile, is not timed.
    """
    ours.run(), theirs.run()
    seconds = np.array([(ours.seconds(), theirs.seconds()) for _ in range(turns)])
    ratios = seconds[:, 0] / seconds[:, 1]
    if target.startswith("≥"):
        ratios = 1.0 / ratios
    return {
        "what": what,
        "against": against,
        "samples": ours.samples,
        "ns_per_sample": 1e9 * float(np.median(seconds[:, 0])),
        "ratio": float(np.median(ratios)),
        "lowest": float(ratios.min()),
        "highest": float(ratios.max()),
        "target": target,
    }
