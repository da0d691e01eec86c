"""Line-to-line feedback: offset, tilt and gain of each axis are corrected from the last lines.

The error of a line, achieved minus desired, is fitted by least squares:

    x, on the constant-speed parts of trace and retrace:  offset + tilt t + gain x_d / range
    y, on the constant-speed part of the trace:           offset + tilt t

t is time in lines, from the middle of the samples fitted. All coefficients are in m. The white
noise of the sensor enters a coefficient as ``LineFit.noise`` of it.

A coefficient plus its correction is the disturbance that would be seen without the feedback. It is
extrapolated to the line that is corrected next (extrapolation.py), whose correction is its
negative. So what line k - delay showed, less what was corrected since, changes the correction.
"""

from collections import deque
from collections.abc import Iterator
from math import ceil

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.online.extrapolation import Extrapolation, Known
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, ErrorLines, end, part
from afm_scan_ros.core.trajectory import TO_AND_FRO, desired, phases, sample_kinds, smooth_step
from afm_scan_ros.core.types import Array, Trace

OFFSET_X, TILT_X, GAIN_X, OFFSET_Y, TILT_Y = range(5)
"""Places of the coefficients, m."""
COEFFICIENTS = 5
CENTRE_X, CENTRE_Y = 0.5, 0.25
"""Middle of what is fitted, in lines from a line's start."""
LEAD = 0.04
"""Seconds from a sample's drive to its reading: two blocks at 50 blocks a second."""
ROUNDING = 1e-9
"""Of a number of lines."""


def lines_of_delay(spec: ScanSpec, held_back: int, latency: float = LEAD) -> int:
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


class LineFit:
    """Fits the coefficients to the error of a line; raises InputError for a scan without them."""

    def __init__(self, spec: ScanSpec) -> None:
        refuse_unsuited(spec)
        start, size = phases(spec).lines.start, spec.samples_per_line
        kinds = sample_kinds(spec, start, size)
        time = np.arange(size) / size
        shape = desired(spec, start, size).x / spec.range_x
        one = np.ones(size)
        self._on_x, self._on_y = kinds.trace | kinds.retrace, kinds.trace
        self._of_x = _solver(np.stack([one, time - CENTRE_X, shape])[:, self._on_x])
        self._of_y = _solver(np.stack([one, time - CENTRE_Y])[:, self._on_y])

    @property
    def noise(self) -> Array:
        """Rms of each coefficient over that of white noise of the sensor, shape (5,)."""
        rows = [np.sqrt(np.sum(each**2, axis=1)) for each in (self._of_x, self._of_y)]
        return np.concatenate(rows)

    def coefficients(self, error: Array) -> Array:
        """Coefficients (m), shape (5,), of a line's error (m) in x and y, shape (2, samples)."""
        x, y = error[0, self._on_x], error[1, self._on_y]
        return np.concatenate((self._of_x @ x, self._of_y @ y))


@frozen(eq=False)
class Feedback:
    """State: how many lines were seen, corrections (5,) of those to come, and what is known.

    ``corrections`` are of the lines ``lines`` to ``lines + delay - 1``, m.
    """

    lines: int
    corrections: tuple[Array, ...]
    known: Known


class LineFeedback:
    """The law: errors of lines in, corrections of later lines out; the state is passed in.

    ``delay`` is in lines. Disturbances slower than ``bandwidth`` (Hz) are reduced.
    """

    def __init__(self, spec: ScanSpec, delay: int) -> None:
        self.delay = delay
        self._fit = LineFit(spec)
        self._extrapolation = Extrapolation(delay, COEFFICIENTS)
        self.bandwidth = self._extrapolation.bandwidth * spec.line_rate

    def at_rest(self) -> Feedback:
        """No line was seen: the first ``delay`` lines are not corrected."""
        nothing = np.zeros(COEFFICIENTS)
        return Feedback(0, (nothing,) * self.delay, self._extrapolation.at_rest())

    def learn(self, before: Feedback, error: Array) -> tuple[Feedback, Array]:
        """Take the error (m), (2, samples), of the next line.

        Returns the state after, and the correction (5,), m, of the line ``delay`` later.
        """
        disturbance = self._fit.coefficients(error) - before.corrections[0]
        known, ahead = self._extrapolation.step(before.known, disturbance)
        following = (*before.corrections[1:], -ahead)
        return Feedback(before.lines + 1, following, known), following[-1]


def refuse_unsuited(spec: ScanSpec) -> None:
    """Raise InputError for a scan whose lines cannot be corrected one by one."""
    if spec.pattern not in TO_AND_FRO:
        raise InputError(
            f"line feedback corrects {' and '.join(TO_AND_FRO)} scans, not '{spec.pattern}': choose"
            " one of these, or scan without it"
        )
    if not spec.turnaround:
        raise InputError(
            "turnaround = 0 leaves line feedback no time for its correction: give 0.1, or scan"
            " without it"
        )


def _solver(basis: Array) -> Array:
    """Return the matrix from samples (n,) to the coefficients of ``basis`` (m, n)."""
    if basis.shape[1] < basis.shape[0]:
        raise InputError(
            f"line feedback needs {basis.shape[0]} samples at constant speed, not"
            f" {basis.shape[1]}: give more samples_per_line or a smaller turnaround"
        )
    return np.asarray(np.linalg.pinv(basis.T), dtype=np.float64)


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
