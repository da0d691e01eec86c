"""The cost of a sample in two ways of going through samples."""

from collections.abc import Callable
from time import perf_counter

from attrs import frozen

from afm_scan_bench.speed.timing.ratios import by_turns, row
from afm_scan_ros.report.table import Row


@frozen
class Task:
    """What is timed, and how many ``samples`` it goes through."""

    run: Callable[[], object]
    samples: int

    def nanoseconds(self) -> float:
        """Time that a sample takes, ns."""
        start = perf_counter()
        self.run()
        return 1e9 * (perf_counter() - start) / self.samples


def race(what: str, ours: Task, against: str, theirs: Task, target: str, turns: int) -> Row:
    """Return the row of our cost over theirs; of our speed over theirs, where the target is ≥."""
    costs = by_turns(turns, ours.nanoseconds, theirs.nanoseconds)
    name = f"{what}, {ours.samples:,} samples"
    if target.startswith("≥"):
        speeds = ([1e9 / cost for cost in each] for each in costs)
        return row(name, against, "samples/s", target, *speeds)
    return row(name, against, "ns/sample", target, *costs)
