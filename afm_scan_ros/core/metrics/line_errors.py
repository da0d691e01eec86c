"""Achieved minus desired displacement, line by line, from two streams of blocks."""

from collections.abc import Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.align import Aligner, WholeLines
from afm_scan_ros.core.types import AXES, Array, Trace

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


class ErrorLines:
    """Aligns desired with achieved displacement, and yields each complete line's error.

    Holds one line and the blocks in flight; samples outside the lines are dropped.
    """

    def __init__(self, lines: range, samples_per_line: int) -> None:
        self._aligner = Aligner((DESIRED, ACHIEVED))
        self._whole = WholeLines(lines, samples_per_line, len(AXES))

    def add(self, name: str, block: Trace) -> Iterator[tuple[int, Array]]:
        """Take a block of one of the two topics; yield the lines that it makes whole.

        Each is its number and its error (m) in x and y, (2, samples_per_line), which the next line
        takes the place of.
        """
        self._aligner.add(name, block)
        for desired, achieved in self._aligner.ready():
            error = np.stack([achieved.x - desired.x, achieved.y - desired.y])
            yield from self._whole.add(desired.first_sample, error)


class LineErrors:
    """Yields the figures of the error of each complete line."""

    def __init__(self, lines: range, samples_per_line: int) -> None:
        self._lines = lines[::samples_per_line]
        self._errors = ErrorLines(lines, samples_per_line)

    def add(self, name: str, block: Trace) -> Iterator[LineError]:
        """Take a block of one of the two topics; yield the lines that it makes whole."""
        for number, line in self._errors.add(name, block):
            rms_x, rms_y = (float(value) for value in np.sqrt(np.mean(line**2, axis=1)))
            max_x, max_y = (float(value) for value in np.abs(line).max(axis=1))
            yield LineError(number, self._lines[number], rms_x, rms_y, max_x, max_y)
