"""A micromanipulator that others recorded: one part is for development, the rest is held out.

Data: github yan9a/DiscreteBacklashOperator, MIT licence, © 2019 Yan Naing Aye. Two files of one
stage, open loop, at 200 Hz: 40 s of a 1 Hz sine, and 71 s of 1 Hz sines that fall and grow, first
driven in proportion to the desired path, then through the author's own inverse.

Our inverse never drove that stage. The displacement under it is predicted: the measured
displacement plus the effect of the change of drive. A second model, fitted to the held-out part
alone, computes this effect; our inverse was not fitted to that part.
"""

from functools import cached_property

import numpy as np
from attrs import frozen

from afm_scan_bench.measured.micromanipulator.transient import end_of_transient
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.effects.vibration import InverseDesign
from afm_scan_ros.core.identification.hysteresis.loops_fit import (
    LoopFit,
    LoopRange,
    LoopRecord,
    fit_loops,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.tables import read_table

FOLDER = "piezo_micromanipulator"
SAMPLE_RATE = 200
PERIOD = SAMPLE_RATE  # samples of the 1 Hz sines
SPAN = LoopRange(0.0, 3.6, cells=40)
DESIGN = InverseDesign(SmoothWeight(corner=20.0, order=2), preview=0.3)
MICRO = 1e-6


@frozen
class Segment:
    """A stretch of the second file, in s from its start; its name says whose inverse drives."""

    name: str
    start: float
    end: float

    @property
    def samples(self) -> slice:
        """Where it lies in a signal."""
        return slice(round(self.start * SAMPLE_RATE), round(self.end * SAMPLE_RATE))


STEADY = Segment("none, ±20 µm", 0.0, 15.0)
FALLING = Segment("none, falling, then rest", 15.0, 25.5)
RESTING = Segment("rest at the desired zero", 21.0, 25.0)
JUDGED = (
    Segment("none, growing", 25.5, 30.0),
    Segment("none, ±20 µm", 30.0, 37.15),
    Segment("author's, ±20 µm", 38.0, 47.0),
    Segment("author's, falling", 47.0, 51.25),
    Segment("author's, rest", 51.25, 56.0),
    Segment("author's, growing", 56.0, 60.0),
    Segment("author's, ±20 µm", 60.0, 70.75),
)
"""All after 25.5 s but for the switching."""
SWITCHING = Segment("author's inverse takes over with a jump", 37.15, 38.0)
WITH_INVERSE = Segment("author's, all", 38.0, 70.75)


class Study:
    """The second file's signals, (n,), in V and m, and what the models make of them.

    ``fit`` is ours, fitted to the first file and the first 25.5 s of the second, each without its
    transient. The sensor's zero is arbitrary: ``predicted`` has the mean of the fitted data, and
    the desired path begins where our model rests while the desired is zero, at 21 to 25 s.
    """

    def __init__(self, span: LoopRange = SPAN) -> None:
        self._span = span
        sine_drive, sine = columns("Model_Vi_Do.dat", 1, 5)
        self.drive, self.measured, path = columns("Test_Vi_Do_Di.dat", 1, 5, 9)
        first = (
            end_of_transient(sine, PERIOD),
            end_of_transient(self.measured[STEADY.samples], PERIOD),
        )
        self.transients = tuple(sample / SAMPLE_RATE for sample in first)
        fitted = (slice(first[1], STEADY.samples.stop), FALLING.samples)
        self.fit = fit_loops(
            [LoopRecord(sine_drive, sine, (slice(first[0], None),)), self._record(fitted)],
            1.0 / SAMPLE_RATE,
            span,
        )
        moved = self.fit.model.apply(self.drive)
        where = slice(fitted[0].start, fitted[1].stop)
        self._origin = float(np.mean((self.measured - moved)[where]))
        self.predicted = moved + self._origin
        self.desired = path + self.predicted[RESTING.samples].mean()

    @cached_property
    def twin(self) -> LoopFit:
        """The model fitted to the held-out part alone."""
        judged = tuple(segment.samples for segment in JUDGED)
        return fit_loops([self._record(judged)], 1.0 / SAMPLE_RATE, self._span)

    @cached_property
    def inverted(self) -> Array:
        """Drive (V) that our inverse asks for the measured displacement, after 25.5 s."""
        return self._invert(self.measured)

    @cached_property
    def drive_of_ours(self) -> Array:
        """Drive (V) that our inverse asks for the desired displacement, after 25.5 s."""
        return self._invert(self.desired)

    @cached_property
    def predicted_with_ours(self) -> Array:
        """Displacement (m) under our inverse's drive, the change of drive as the twin sees it."""
        twin = self.twin.model
        return self.measured + twin.apply(self.drive_of_ours) - twin.apply(self.drive)

    def _record(self, fitted: tuple[slice, ...]) -> LoopRecord:
        return LoopRecord(self.drive, self.measured, fitted)

    def _invert(self, displacement: Array) -> Array:
        """Invert a displacement (m) from 25.5 s on; before, our model gets its own."""
        target = self.predicted.copy()
        target[FALLING.samples.stop :] = displacement[FALLING.samples.stop :]
        return self.fit.model.invert(target - self._origin, DESIGN)


def columns(name: str, *numbers: int) -> tuple[Array, ...]:
    """Columns of a file: the first in V, the others from µm to m."""
    table = read_table(measured_data(f"{FOLDER}/{name}"))
    drive, *displacements = (table.column(number - 1) for number in numbers)
    return drive, *(MICRO * displacement for displacement in displacements)
