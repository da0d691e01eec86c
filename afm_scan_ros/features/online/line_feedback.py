"""Line-to-line feedback: offset, tilt and gain of each axis are corrected from the last lines.

The error of a line, achieved minus desired, is fitted by least squares:

    x, on the constant-speed parts of trace and retrace:  offset + tilt t + gain x_d / range
    y, on the constant-speed part of the trace:           offset + tilt t

t is time in lines, from the middle of the samples fitted. All coefficients are in m.

A coefficient plus its correction is the disturbance that would be seen without the feedback. It is
extrapolated to the line that is corrected next (extrapolation.py), whose correction is its
negative. So what line k - delay showed, less what was corrected since, changes the correction.
"""

from collections import deque
from functools import partial

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import DRIVE, LineErrors, end
from afm_scan_ros.core.trajectory import desired, phases, sample_kinds
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.features.online import line_correction
from afm_scan_ros.features.online.extrapolation import Extrapolation
from afm_scan_ros.nodes.parameters import NodeParameter, OnlineOption

OFFSET_X, TILT_X, GAIN_X, OFFSET_Y, TILT_Y = range(5)
"""Places of the coefficients, m."""
COEFFICIENTS = 5
CENTRE_X, CENTRE_Y = 0.5, 0.25
"""Middle of what is fitted, in lines from a line's start."""


class LineFit:
    """Fits the coefficients to the error of a line; raises InputError for a scan without them."""

    def __init__(self, spec: ScanSpec) -> None:
        line_correction.refuse_unsuited("line feedback", spec)
        start, size = phases(spec).lines.start, spec.samples_per_line
        kinds = sample_kinds(spec, start, size)
        time = np.arange(size) / size
        shape = desired(spec, start, size).x / spec.range_x
        one = np.ones(size)
        self._on_x, self._on_y = kinds.trace | kinds.retrace, kinds.trace
        self._of_x = _solver(np.stack([one, time - CENTRE_X, shape])[:, self._on_x])
        self._of_y = _solver(np.stack([one, time - CENTRE_Y])[:, self._on_y])

    def coefficients(self, error: Array) -> Array:
        """Coefficients (m), shape (5,), of a line's error (m) in x and y, shape (2, samples)."""
        x, y = error[0, self._on_x], error[1, self._on_y]
        return np.concatenate((self._of_x @ x, self._of_y @ y))


def _solver(basis: Array) -> Array:
    """Return the matrix from samples (n,) to the coefficients of ``basis`` (m, n)."""
    if basis.shape[1] < basis.shape[0]:
        raise InputError(
            f"line feedback needs {basis.shape[0]} samples at constant speed, not"
            f" {basis.shape[1]}: give more samples_per_line or a smaller turnaround"
        )
    return np.asarray(np.linalg.pinv(basis.T), dtype=np.float64)


class FedBack(line_correction.LineCorrection):
    """Adds the corrections of lines, which follow from the errors of those before, to a reference.

    On the constant-speed parts of a line its correction is ``offset + tilt t + gain x_d / range``.
    Raises InputError for a scan without such lines.
    """

    def __init__(self, spec: ScanSpec, delay: int) -> None:
        nothing = np.zeros(COEFFICIENTS)
        super().__init__(spec, delay, nothing)
        self._fit, self._range, self._latest = LineFit(spec), spec.range_x, nothing
        self._errors = LineErrors(phases(spec).lines, spec.samples_per_line)
        self._extrapolation = Extrapolation(delay, COEFFICIENTS)
        self._known = self._extrapolation.at_rest()
        self._ahead = deque([nothing] * delay)  # corrections of the lines to be achieved next
        self.remark = (
            f"line feedback: line k is corrected by lines up to k - {delay}; drifts"
            f" slower than {self._extrapolation.bandwidth * spec.line_rate:.3g} Hz are reduced"
        )

    def corrected_by(self) -> dict[str, float]:
        """Return the offset (m) by which each axis is corrected in the last line that was begun."""
        return {"x": float(self._latest[OFFSET_X]), "y": float(self._latest[OFFSET_Y])}

    def effect(self) -> str:
        """Say by how much the last line that was begun is corrected."""
        moved = self.corrected_by().items()
        corrections = ", ".join(f"{axis} by {1e6 * offset:.3g} µm" for axis, offset in moved)
        return f"line feedback corrects {corrections}"

    def observe(self, name: str, block: Trace) -> None:
        """Take the next block of a topic; learn from the error of each line that it makes whole."""
        if name == DRIVE:
            return
        for line, error in self._errors.samples(name, block):
            disturbance = self._fit.coefficients(error) - self._ahead.popleft()
            self._known, ahead = self._extrapolation.step(self._known, disturbance)
            self._values[line + self.delay] = -ahead
            self._ahead.append(-ahead)

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
    return FedBack(spec, line_correction.lines_of_delay(spec, held_back, latency))


def _paths(correction: Array, time: Array, shape: Array) -> tuple[Array, Array]:
    """Corrections (m) of x and y at times in lines from a line's start; ``shape`` is x / range."""
    x = correction[OFFSET_X] + correction[TILT_X] * (time - CENTRE_X) + correction[GAIN_X] * shape
    return x, correction[OFFSET_Y] + correction[TILT_Y] * (time - CENTRE_Y)


LINE_FEEDBACK = OnlineOption(
    help="Correct offset, tilt and gain of each line from the lines before it.",
    parameters=(
        NodeParameter(
            "line_feedback",
            default=False,
            description="Whether offset, tilt and gain are corrected from the last lines",
        ),
    ),
    refuse_unsuited=partial(line_correction.refuse_unsuited, "line feedback"),
    correction=lambda _: fed_back,
)
