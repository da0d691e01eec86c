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

from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, InverseSettings
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, trace_of
from afm_scan_ros.files.tables import read_table
from afm_scan_ros.identification import identify
from afm_scan_ros.model import Model

FOLDER = "piezo_micromanipulator"
SAMPLE_RATE = 200
T = 1.0 / SAMPLE_RATE
PERIOD = SAMPLE_RATE  # samples of the 1 Hz sines
SETTINGS = InverseSettings(weight=SmoothWeight(corner=20.0, order=2), preview=0.3)
UNLIMITED = DriveLimits(float("inf"), float("inf"))
MICRO = 1e-6


@frozen
class Segment:
    """A stretch of the second file, in s from its start; its name states whose inverse drives."""

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

    ``model`` is ours, identified from the first file and the second one's first 25.5 s. The
    sensor's zero is arbitrary: ``predicted`` has the mean of the data fitted, and the desired path
    begins where our model rests while the desired is zero, at 21 to 25 s.
    """

    def __init__(self) -> None:
        sine_drive, sine = columns("Model_Vi_Do.dat", 1, 5)
        self.drive, self.measured, path = columns("Test_Vi_Do_Di.dat", 1, 5, 9)
        last = FALLING.samples.stop
        falling = self.drive[:last], self.measured[:last]
        self.model = identify([record("sine", sine_drive, sine), record("falling", *falling)])
        moved = self.model.predict(self.drive, T)
        self._origin = float(np.mean((self.measured - moved)[PERIOD:last]))
        self.predicted = moved + self._origin
        self.desired = path + self.predicted[RESTING.samples].mean()

    @property
    def fitted(self) -> float:
        """Rms misfit of the fit, m, to all data fitted."""
        each = [one.by_fit for one in self.model.fit.axes["x"].records]
        squares = sum((one.samples - 1) * one.sigma**2 for one in each)
        return float(np.sqrt(squares / sum(one.samples for one in each)))

    @cached_property
    def twin(self) -> Model:
        """The model fitted to the held-out part alone."""
        parts = [
            slice(JUDGED[0].samples.start, SWITCHING.samples.start),
            WITH_INVERSE.samples,
        ]
        return identify(
            [record(f"held out from {p.start}", self.drive[p], self.measured[p]) for p in parts]
        )

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
        drives = self.drive_of_ours, self.drive
        ours, theirs = (self.twin.predict(drive, T, beyond="extend") for drive in drives)
        return self.measured + ours - theirs

    def _invert(self, displacement: Array) -> Array:
        """Invert a displacement (m) from 25.5 s on; before, our model gets its own."""
        target = self.predicted.copy()
        target[FALLING.samples.stop :] = displacement[FALLING.samples.stop :]
        inverse = Compensation(self.model.scanner, T, INVERSES, SETTINGS, UNLIMITED)
        return inverse.whole(trace_of((target - self._origin)[:, np.newaxis], ("x",), T)).x


def record(name: str, drive: Array, displacement: Array) -> Record:
    """Record of a drive (V) and a displacement (m), both (n,)."""
    return Record(drive, displacement, T, name=name)


def columns(name: str, *numbers: int) -> tuple[Array, ...]:
    """Columns of a file: the first in V, the others from µm to m."""
    table = read_table(measured_data(f"{FOLDER}/{name}"))
    drive, *displacements = table.columns([number - 1 for number in numbers])
    return drive, *(MICRO * displacement for displacement in displacements)
