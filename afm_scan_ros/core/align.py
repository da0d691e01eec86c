"""Aligns streams of blocks: to common runs of samples, and to whole lines of a scan."""

from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np
from attrs import define, field

from afm_scan_ros.core.types import Array, Trace


def part(trace: Trace, start: int, stop: int) -> Trace:
    """Samples ``start`` to ``stop - 1`` of a scan, out of a trace that holds them."""
    if (start, stop) == (trace.first_sample, end(trace)):
        return trace
    cut = slice(start - trace.first_sample, stop - trace.first_sample)
    return Trace(start, trace.sample_period, trace.x[cut], trace.y[cut])


def end(trace: Trace) -> int:
    """Return the first sample after a trace."""
    return trace.first_sample + trace.x.size


@define
class Aligner:
    """Takes blocks of each stream, and yields the samples that all streams have."""

    names: Sequence[str]
    _waiting: dict[str, deque[Trace]] = field(init=False)

    def __attrs_post_init__(self) -> None:
        self._waiting = {name: deque() for name in self.names}

    def add(self, name: str, trace: Trace) -> None:
        """Take the next block of a stream."""
        if trace.x.size:
            self._waiting[name].append(trace)

    def ready(self) -> Iterator[tuple[Trace, ...]]:
        """Yield runs of the same samples, one Trace for each name, as long as all have some."""
        while all(self._waiting.values()):
            heads = [self._waiting[name][0] for name in self.names]
            start, stop = heads[0].first_sample, min(end(head) for head in heads)
            yield tuple(part(head, start, stop) for head in heads)
            for name, head in zip(self.names, heads, strict=True):
                self._advance(name, head, stop)

    def _advance(self, name: str, head: Trace, stop: int) -> None:
        self._waiting[name].popleft()
        if end(head) > stop:
            self._waiting[name].appendleft(part(head, stop, end(head)))


class WholeLines:
    """Gathers lines of ``size`` samples in so many ``rows``; those outside ``lines`` are dropped.

    Keeps one line, however long the scan is.
    """

    def __init__(self, lines: range, size: int, rows: int) -> None:
        self._lines = lines
        self._line = np.empty((rows, size))

    def add(self, first: int, run: Array) -> Iterator[tuple[int, Array]]:
        """Take the scan's samples from number ``first`` on, (rows, n), which follow the last ones.

        Yields each line that they make whole: its number and its samples, (rows, size), which the
        next line takes the place of.
        """
        size = self._line.shape[1]
        position, stop = max(first, self._lines.start), min(first + run.shape[1], self._lines.stop)
        while position < stop:
            number, way = divmod(position - self._lines.start, size)
            count = min(stop - position, size - way)
            at = position - first
            self._line[:, way : way + count] = run[:, at : at + count]
            position += count
            if way + count == size:
                yield number, self._line
