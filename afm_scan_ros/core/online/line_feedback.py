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

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.online.extrapolation import Extrapolation, Known
from afm_scan_ros.core.online.line_correction import LineCorrection, lines_of_delay
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import DRIVE, ErrorLines, end
from afm_scan_ros.core.trajectory import TO_AND_FRO, desired, phases, sample_kinds
from afm_scan_ros.core.types import Array, Trace

OFFSET_X, TILT_X, GAIN_X, OFFSET_Y, TILT_Y = range(5)
"""Places of the coefficients, m."""
COEFFICIENTS = 5
CENTRE_X, CENTRE_Y = 0.5, 0.25
"""Middle of what is fitted, in lines from a line's start."""


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


class FedBack(LineCorrection):
    """Adds the corrections of lines, which follow from the errors of those before, to a reference.

    On the constant-speed parts of a line its correction is ``offset + tilt t + gain x_d / range``.
    """

    def __init__(self, spec: ScanSpec, law: LineFeedback) -> None:
        super().__init__(spec, law.delay, np.zeros(COEFFICIENTS))
        self.remark = (
            f"line feedback: line k is corrected by lines up to k - {law.delay}; drifts"
            f" slower than {law.bandwidth:.3g} Hz are reduced"
        )
        self._law, self._range = law, spec.range_x
        self._errors = ErrorLines(phases(spec).lines, spec.samples_per_line)
        self._state, self._latest = law.at_rest(), np.zeros(COEFFICIENTS)

    def corrected_by(self) -> dict[str, float]:
        """Return the offset (m) by which each axis is corrected in the last line that was begun."""
        return {"x": float(self._latest[OFFSET_X]), "y": float(self._latest[OFFSET_Y])}

    def effect(self) -> str:
        """Say by how much the last line that was begun is corrected."""
        moved = self.corrected_by().items()
        corrections = ", ".join(f"{axis} by {1e6 * offset:.3g} µm" for axis, offset in moved)
        return f"line feedback corrects {corrections}"

    def observe(self, name: str, block: Trace) -> None:
        """Take the next block of a topic: the desired less the achieved displacement is learned."""
        if name == DRIVE:
            return
        for line, error in self._errors.add(name, block):
            self._state, ahead = self._law.learn(self._state, error)
            self._values[line + self.delay] = ahead

    def _correct(self, line: int, before: Array, now: Array, block: Trace) -> Trace:
        """Correct a block by the corrections (5,), m, of the line before and of this one."""
        self._latest = now
        if line < 0:
            return block
        samples = np.arange(block.first_sample, end(block))
        rise = self._rise(line, block)
        time = (np.minimum(samples, self._lines.stop) - self._lines.start) / self._size - line
        shape = block.x / self._range
        old_x, old_y = _paths(before, time + 1.0, shape)
        new_x, new_y = _paths(now, time, shape)
        x = block.x + old_x + rise * (new_x - old_x)
        y = block.y + old_y + rise * (new_y - old_y)
        return Trace(block.first_sample, block.sample_period, x, y)


def fed_back(_: ScannerModel, spec: ScanSpec, held_back: int, latency: float) -> FedBack:
    """Return the line feedback of a scan; raises InputError for a scan that it does not suit."""
    return FedBack(spec, LineFeedback(spec, lines_of_delay(spec, held_back, latency)))


def _paths(correction: Array, time: Array, shape: Array) -> tuple[Array, Array]:
    """Corrections (m) of x and y at times in lines from a line's start; ``shape`` is x / range."""
    x = correction[OFFSET_X] + correction[TILT_X] * (time - CENTRE_X) + correction[GAIN_X] * shape
    return x, correction[OFFSET_Y] + correction[TILT_Y] * (time - CENTRE_Y)
