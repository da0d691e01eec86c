"""Streams of blocks: aligned, gathered to whole lines, and what is read off them."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from math import ceil, nan

import numpy as np
from attrs import define, field, frozen

from afm_scan_ros.core.types import AXES, Array, Trace


def part(trace: Trace, start: int, stop: int) -> Trace:
    """Samples ``start`` to ``stop - 1`` of a scan, out of a trace that holds them."""
    if (start, stop) == (trace.first_sample, end(trace)):
        return trace
    cut = slice(start - trace.first_sample, stop - trace.first_sample)
    return Trace(start, trace.sample_period, trace.x[cut], trace.y[cut])


def end(trace: Trace) -> int:
    """Return the first sample after a trace."""
    return trace.first_sample + trace.x.size


def within(where: range, run: Sequence[Trace]) -> tuple[Trace, ...]:
    """Return the samples of a run of several signals that lie in a range; nothing if none does."""
    start, stop = max(where.start, run[0].first_sample), min(where.stop, end(run[0]))
    return tuple(part(trace, start, stop) for trace in run) if start < stop else ()


MAX_BLOCK = 10_000
"""Most samples that one message may carry."""


def cut(trace: Trace) -> Iterator[Trace]:
    """Yield a trace in blocks of ``MAX_BLOCK`` samples at most."""
    for first in range(trace.first_sample, end(trace), MAX_BLOCK):
        yield part(trace, first, min(first + MAX_BLOCK, end(trace)))


def cut_as(blocks: Iterable[Trace], trace: Trace) -> Iterator[Trace]:
    """Yield a trace cut where blocks end, and as ``cut`` does; what lies before and after, too."""
    start = trace.first_sample
    for block in blocks:
        stop = max(start, min(end(block), end(trace)))
        yield from cut(part(trace, start, stop))
        start = stop


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
    """Gathers lines of ``size`` samples in so many ``rows``, one at a time; drops all others."""

    def __init__(self, lines: range, size: int, rows: int) -> None:
        self._lines = lines
        self._line = np.empty((rows, size))

    def add(self, first: int, run: Array) -> Iterator[tuple[int, Array]]:
        """Take samples from number ``first`` on, (rows, n), which follow the last ones.

        Yields each whole line: its number and its samples, (rows, size), overwritten by the next.
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


DESIRED, ACHIEVED = "desired_displacement", "achieved_displacement"
"""Topics whose difference is the error."""


@frozen
class LineError:
    """Error of one line, m: its first sample, the rms about zero and the largest size."""

    line: int
    first_sample: int
    rms_x: float
    rms_y: float
    max_x: float
    max_y: float


class LineErrors:
    """Aligns desired with achieved displacement, and yields each complete line's error."""

    def __init__(self, lines: range, samples_per_line: int) -> None:
        self._aligner = Aligner((DESIRED, ACHIEVED))
        self._whole = WholeLines(lines, samples_per_line, len(AXES))
        self._firsts = lines[::samples_per_line]

    def add(self, name: str, block: Trace) -> Iterator[LineError]:
        """Take a block of one of the two topics; yield the lines that it makes whole."""
        for number, line in self.samples(name, block):
            yield line_error(number, self._firsts[number], line)

    def samples(self, name: str, block: Trace) -> Iterator[tuple[int, Array]]:
        """Yield each whole line's number and error (m), (2, samples), overwritten by the next."""
        self._aligner.add(name, block)
        for desired, achieved in self._aligner.ready():
            error = np.stack([achieved.x - desired.x, achieved.y - desired.y])
            yield from self._whole.add(desired.first_sample, error)


def line_error(number: int, first_sample: int, error: Array) -> LineError:
    """Return the figures of the error of a line, m, (2, samples)."""
    rms_x, rms_y = (float(value) for value in np.sqrt(np.mean(error**2, axis=1)))
    max_x, max_y = (float(value) for value in np.abs(error).max(axis=1))
    return LineError(number, first_sample, rms_x, rms_y, max_x, max_y)


MONITOR_RATE = 200.0
"""Samples a second, at most."""


def monitor_step(sample_period: float) -> int:
    """Return the number of samples (period in s) from one sample for viewers to the next."""
    return ceil(1.0 / (MONITOR_RATE * sample_period) - 1e-9)


DRIVE = "drive_voltage"


@frozen
class MonitorSample:
    """One sample: displacement in m, drive in V, both not a number where they are not known."""

    sample: int
    desired_x: float
    desired_y: float
    achieved_x: float
    achieved_y: float
    error_x: float
    error_y: float
    drive_x: float
    drive_y: float


class MonitorSamples:
    """Aligns three streams of blocks, and yields samples, ``MONITOR_RATE`` a second at most.

    No sample waits for the drive: a recording may hold none.
    """

    def __init__(self, sample_period: float) -> None:
        self._step = monitor_step(sample_period)
        self._aligner = Aligner(("desired_displacement", "achieved_displacement"))
        self._drive: deque[Trace] = deque()

    def add(self, name: str, block: Trace) -> Iterator[MonitorSample]:
        """Take the next block of one of the three topics; yield the samples that it completes."""
        if name == DRIVE:
            self._drive.append(block)
            return
        self._aligner.add(name, block)
        for desired, achieved in self._aligner.ready():
            first = desired.first_sample
            for sample in range(first + -first % self._step, end(desired), self._step):
                yield self._sample(sample, desired, achieved)

    def _sample(self, sample: int, desired: Trace, achieved: Trace) -> MonitorSample:
        at = sample - desired.first_sample
        (dx, dy), (ax, ay) = ((float(t.x[at]), float(t.y[at])) for t in (desired, achieved))
        drive_x, drive_y = self._drive_at(sample)
        return MonitorSample(sample, dx, dy, ax, ay, ax - dx, ay - dy, drive_x, drive_y)

    def _drive_at(self, sample: int) -> tuple[float, float]:
        """Return the drive of a sample, and forget what lies before it."""
        while self._drive and end(self._drive[0]) <= sample:
            self._drive.popleft()
        if not self._drive or (head := self._drive[0]).first_sample > sample:
            return nan, nan
        at = sample - head.first_sample
        return float(head.x[at]), float(head.y[at])
