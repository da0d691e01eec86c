"""The desired displacement with the corrections of line-to-line feedback, on streams of blocks."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.align import end, part
from afm_scan_ros.core.learning.line_feedback import (
    CENTRE_X,
    CENTRE_Y,
    COEFFICIENTS,
    GAIN_X,
    OFFSET_X,
    OFFSET_Y,
    TILT_X,
    TILT_Y,
    LineFeedback,
    turn_samples,
)
from afm_scan_ros.core.metrics.line_errors import ACHIEVED, DESIRED, ErrorLines
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.trajectory.shapes import smooth_step
from afm_scan_ros.core.types import Array, Trace


class CorrectedLines:
    """Adds the corrections of lines to the desired displacement.

    On the constant-speed parts of a line its correction is ``offset + tilt t + gain x_d / range``.
    In the turn-around before the line it is reached from that of the line before, by a smooth step
    with continuous velocity and acceleration. After the last line its correction is held.
    """

    def __init__(self, spec: ScanSpec) -> None:
        self._lines, self._size = phases(spec).lines, spec.samples_per_line
        self._turn = turn_samples(spec)
        self._last = spec.lines - 1
        self._range = spec.range_x

    def line_at(self, sample: int) -> int:
        """Return the line whose correction a sample has, -1 before the first."""
        line = (sample - self._lines.start + self._turn) // self._size
        return max(-1, min(line, self._last))

    def part_of(self, line: int, block: Trace) -> Trace:
        """Return the beginning of a block that has one line's correction."""
        stop = end(block) if line == self._last else min(end(block), self.begins(line + 1))
        return part(block, block.first_sample, stop)

    def begins(self, line: int) -> int:
        """First sample that depends on a line's correction: the turn-around before it begins."""
        return self._lines.start + line * self._size - self._turn

    def corrected(self, line: int, before: Array, now: Array, block: Trace) -> Trace:
        """Return a block that has one line's correction throughout, corrected.

        ``before`` and ``now`` are the corrections (5,), m, of the line before and of this one.
        """
        if line < 0:
            return block
        samples = np.arange(block.first_sample, end(block))
        rise = smooth_step((samples - self.begins(line)) / (2.0 * self._turn))
        time = (np.minimum(samples, self._lines.stop) - self._lines.start) / self._size - line
        shape = block.x / self._range
        old_x, old_y = _paths(before, time + 1.0, shape)
        new_x, new_y = _paths(now, time, shape)
        x = block.x + old_x + rise * (new_x - old_x)
        y = block.y + old_y + rise * (new_y - old_y)
        return Trace(block.first_sample, block.sample_period, x, y)


class FedBack:
    """Takes what is desired and what was achieved, and yields the corrected desired displacement.

    A block waits until the lines that its correction follows from were achieved. Blocks are cut
    where a line's correction begins, so that the result depends neither on timing nor on how far
    the scanner is ahead.
    """

    def __init__(self, spec: ScanSpec, law: LineFeedback) -> None:
        self._law = law
        self._place = CorrectedLines(spec)
        self._errors = ErrorLines(phases(spec).lines, spec.samples_per_line)
        self._waiting: deque[Trace] = deque()
        self._state = law.at_rest()
        self._line = -1
        self._corrections = dict.fromkeys(range(-1, law.delay), np.zeros(COEFFICIENTS))

    @property
    def awaited(self) -> int | None:
        """The line that must be achieved before more can be corrected; None where none must."""
        if not self._waiting:
            return None
        line = self._place.line_at(self._waiting[0].first_sample)
        return None if line in self._corrections else line - self._law.delay

    def corrected_by(self) -> dict[str, float]:
        """Return the offset (m) by which each axis is corrected in the last line that was begun."""
        latest = self._corrections[self._line]
        return {"x": float(latest[OFFSET_X]), "y": float(latest[OFFSET_Y])}

    def desired(self, block: Trace, reference: Trace) -> Iterator[Trace]:
        """Take the next block of the desired displacement, m; yield what can be corrected.

        ``reference`` is what is to be followed in its place: the same without other corrections.
        """
        self._waiting.append(reference)
        self._learn(DESIRED, block)
        yield from self._corrected()

    def achieved(self, block: Trace) -> Iterator[Trace]:
        """Take the next block of the achieved displacement, m; yield what can be corrected."""
        self._learn(ACHIEVED, block)
        yield from self._corrected()

    def _learn(self, name: str, block: Trace) -> None:
        for line, error in self._errors.add(name, block):
            self._state, ahead = self._law.learn(self._state, error)
            self._corrections[line + self._law.delay] = ahead

    def _corrected(self) -> Iterator[Trace]:
        while self._waiting and self.awaited is None:
            block = self._waiting.popleft()
            line = self._place.line_at(block.first_sample)
            now = self._place.part_of(line, block)
            if end(now) < end(block):
                self._waiting.appendleft(part(block, end(now), end(block)))
            before = self._corrections[max(-1, line - 1)]
            self._corrections.pop(line - 2, None)
            self._line = line
            yield self._place.corrected(line, before, self._corrections[line], now)


def _paths(correction: Array, time: Array, shape: Array) -> tuple[Array, Array]:
    """Corrections (m) of x and y at times in lines from a line's start; ``shape`` is x / range."""
    x = correction[OFFSET_X] + correction[TILT_X] * (time - CENTRE_X) + correction[GAIN_X] * shape
    return x, correction[OFFSET_Y] + correction[TILT_Y] * (time - CENTRE_Y)
