"""Runs of samples, cut anywhere, made into the whole lines of a scan."""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.types import Array


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
