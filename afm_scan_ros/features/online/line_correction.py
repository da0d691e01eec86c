"""Corrections of a scan's reference whose values change from line to line, on streams of blocks."""

from abc import abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator
from math import ceil

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_inversion import LATENCY, OnlineCorrection
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import end, part
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases, smooth_step
from afm_scan_ros.core.types import Array, Trace

ROUNDING = 1e-9
"""Of a number of lines."""


def lines_of_delay(spec: ScanSpec, held_back: int, latency: float = LATENCY) -> int:
    """Lines from one that is measured to the first that can be corrected by it, at least 1.

    The drive is known ``held_back`` samples after the desired displacement, and a reading
    ``latency`` s after its drive. The correction of a line begins in the turn-around before it, and
    a line is measured when the first half of the turn-around after it is.
    """
    late = held_back + turn_samples(spec) + latency / spec.sample_period
    return 1 + ceil(late / spec.samples_per_line - ROUNDING)


def turn_samples(spec: ScanSpec) -> int:
    """Samples of a turn-around on either side of the corner."""
    return ceil(0.5 * spec.turnaround * (spec.samples_per_line // 2))


def refuse_unsuited(name: str, spec: ScanSpec) -> None:
    """Raise InputError where a correction of this name cannot correct a scan line by line."""
    if spec.pattern not in TO_AND_FRO:
        raise InputError(
            f"{name} corrects {' and '.join(TO_AND_FRO)} scans, not '{spec.pattern}': choose one of"
            " these, or scan without it"
        )
    if not spec.turnaround:
        raise InputError(
            f"turnaround = 0 leaves {name} no time for its correction: give 0.1, or scan without it"
        )


class LineCorrection(OnlineCorrection):
    """Corrects each line by values, arrays of one shape, that follow from lines before it.

    The values of the first ``delay`` lines are ``unchanged``. What line k shows is in force from
    line k + ``delay`` on. In the turn-around before a line its values are reached from those of the
    line before, by a smooth step with continuous velocity and acceleration. After the last line its
    values are held. A block waits until the lines on which it depends were measured, and blocks are
    cut where a line's values come into force. So the result depends neither on timing nor on how
    the signals are cut into blocks.
    """

    def __init__(self, spec: ScanSpec, delay: int, unchanged: Array) -> None:
        self.delay = delay
        self._lines, self._size = phases(spec).lines, spec.samples_per_line
        self._turn, self._last = turn_samples(spec), spec.lines - 1
        self._waiting: deque[Trace] = deque()
        self._values = dict.fromkeys(range(-2, delay), unchanged)

    @property
    def awaited(self) -> int | None:
        """The line that must be achieved before more can be corrected; None where none must."""
        if not self._waiting:
            return None
        line = self._line_at(self._waiting[0].first_sample)
        return None if line in self._values else line - self.delay

    def corrected(self, references: Iterable[Trace] = ()) -> Iterator[Trace]:
        """Take the next blocks of the reference, m; yield what can be corrected."""
        yield from self._ready()
        for reference in references:
            if reference.x.size:
                self._waiting.append(reference)
            yield from self._ready()

    @abstractmethod
    def _correct(self, line: int, before: Array, now: Array, block: Trace) -> Trace:
        """Correct a block of one line by the values of the line before and of this one."""

    def _rise(self, line: int, block: Trace) -> Array:
        """Return how far a block's samples are from the line before's values, 0, to its own, 1."""
        samples = np.arange(block.first_sample, end(block))
        return smooth_step((samples - self._begins(line)) / (2.0 * self._turn))

    def _ready(self) -> Iterator[Trace]:
        while self._waiting and self.awaited is None:
            block = self._waiting.popleft()
            line = self._line_at(block.first_sample)
            stop = end(block) if line == self._last else min(end(block), self._begins(line + 1))
            if stop < end(block):
                self._waiting.appendleft(part(block, stop, end(block)))
            for old in [each for each in self._values if each < line - 1]:
                del self._values[old]
            before, now = self._values[line - 1], self._values[line]
            yield self._correct(line, before, now, part(block, block.first_sample, stop))

    def _line_at(self, sample: int) -> int:
        """Return the line whose values a sample has, -1 before the first."""
        line = (sample - self._lines.start + self._turn) // self._size
        return max(-1, min(line, self._last))

    def _begins(self, line: int) -> int:
        """First sample that depends on a line's values: the turn-around before it begins."""
        return self._lines.start + line * self._size - self._turn
