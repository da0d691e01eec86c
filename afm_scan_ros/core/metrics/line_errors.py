"""Achieved minus desired displacement, line by line, from two streams of blocks."""

from collections.abc import Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.align import Aligner
from afm_scan_ros.core.types import Array, Trace


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
    """Joins what was desired with what was achieved, and gives up each line once it is whole.

    Keeps no more than the blocks in flight and one line; samples outside the lines are dropped.
    """

    def __init__(self, lines: range, samples_per_line: int) -> None:
        self._lines = lines
        self._size = samples_per_line
        self._next = lines.start
        self._errors = np.empty((2, 0))
        self._aligner = Aligner(("desired_displacement", "achieved_displacement"))

    def add(self, name: str, block: Trace) -> Iterator[LineError]:
        """Take a block of one of the two topics; yield the lines that it makes whole."""
        self._aligner.add(name, block)
        for desired, achieved in self._aligner.ready():
            error = np.stack([achieved.x - desired.x, achieved.y - desired.y])
            early = max(0, self._lines.start - desired.first_sample)
            self._errors = np.hstack([self._errors, error[:, early:]])
        while self._next < self._lines.stop and self._errors.shape[1] >= self._size:
            error, self._errors = np.hsplit(self._errors, [self._size])
            yield self._line(error)

    def _line(self, error: Array) -> LineError:
        first = self._next
        self._next += self._size
        rms_x, rms_y = (float(value) for value in np.sqrt(np.mean(error**2, axis=1)))
        max_x, max_y = (float(value) for value in np.abs(error).max(axis=1))
        number = (first - self._lines.start) // self._size
        return LineError(number, first, rms_x, rms_y, max_x, max_y)
