"""Achieved minus desired displacement, line by line, from two streams of blocks."""

from collections.abc import Iterator

import numpy as np
from attrs import frozen

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
        self._samples_per_line = samples_per_line
        self._next = lines.start
        self._waiting = {"desired": np.empty((2, 0)), "achieved": np.empty((2, 0))}

    def add(self, kind: str, block: Trace) -> Iterator[LineError]:
        """Take a block, ``desired`` or ``achieved``; yield the lines that it makes whole."""
        from_line = slice(max(0, self._lines.start - block.first_sample), None)
        samples = np.stack([block.x, block.y])[:, from_line]
        self._waiting[kind] = np.hstack([self._waiting[kind], samples])
        size = self._samples_per_line
        while self._next < self._lines.stop and self._shortest() >= size:
            error = self._waiting["achieved"][:, :size] - self._waiting["desired"][:, :size]
            self._waiting = {name: held[:, size:] for name, held in self._waiting.items()}
            yield self._line(error)

    def _shortest(self) -> int:
        return min(held.shape[1] for held in self._waiting.values())

    def _line(self, error: Array) -> LineError:
        first = self._next
        self._next += self._samples_per_line
        rms_x, rms_y = (float(value) for value in np.sqrt(np.mean(error**2, axis=1)))
        max_x, max_y = (float(value) for value in np.abs(error).max(axis=1))
        number = (first - self._lines.start) // self._samples_per_line
        return LineError(number, first, rms_x, rms_y, max_x, max_y)
