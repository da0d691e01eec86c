"""The residual of a scan line by line, as it is scanned, beside what is known of the model's error.

Displacement is relative, so each line's mean is left out; but a mean that moves from line to line
is a residual too, below the line rate: drift shows in nothing else.

Decides when a scanner's residual exceeds its detection limit, and when no longer.
"""

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np
from attrs import define, evolve, frozen

from afm_scan_ros.core.align import WholeLines
from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import VIBRATING, DetectionLimit, detection_limit
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import Prediction
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases
from afm_scan_ros.core.types import AXES, Array, Trace

TYPICAL_LINES = 64
"""Lines whose means are compared."""
SHARP_TURN = 3.0
"""Times the floor that vibrations of a healthy scanner reach on a line, and nothing slower.

The model discrepancy is that of a record spread over all frequencies; a harmonic of the line rate
may meet a mode that the model lacks.
"""
DETECTION_LIMITS = 64_000
"""Samples of lines, two at least, from which the floor is told before they are scanned."""


@frozen
class AxisResidual:
    """Residual of one axis on one line, its mean left out: rms and largest size, m.

    ``normalised_residual`` is its rms over what is to be expected, in the band (Hz) where that is
    largest.
    """

    rms: float
    largest: float
    normalised_residual: float
    band: tuple[float, float]


@frozen
class LineResidual:
    """Residual of one line: its number, its first sample, and each axis."""

    line: int
    first_sample: int
    x: AxisResidual
    y: AxisResidual

    def axis(self, name: str) -> AxisResidual:
        """Return the residual of axis ``"x"`` or ``"y"``."""
        return {"x": self.x, "y": self.y}[name]


def expected_limits(model: ScannerModel, spec: ScanSpec) -> dict[str, DetectionLimit]:
    """DetectionLimit of each axis of a scan that follows what is desired.

    Raises InputError where the model states no model discrepancy.
    """
    lines = max(2, DETECTION_LIMITS // spec.samples_per_line)
    first = evolve(spec, lines=min(spec.lines, lines))
    path = desired(first, 0, phases(first).total)
    floors = {}
    for name in AXES:
        known = model.axis(name).model_discrepancies
        if not known:
            raise InputError(
                f"the model of axis {name} states no model_discrepancy, so no residual is too"
                f" large:"
                " identify it anew, with its validation record, or scan unwatched"
            )
        floors[name] = detection_limit(known, path.axis(name), spec.sample_period)
    return floors


class LineResiduals:
    """Follows drive and measured displacement, and gives up each line once it is whole.

    Keeps one line and the means of some, however long the scan is.
    """

    def __init__(
        self, model: ScannerModel, spec: ScanSpec, floors: Mapping[str, DetectionLimit]
    ) -> None:
        self._prediction = Prediction(model, spec.sample_period)
        self._state = self._prediction.at_rest()
        self._spec, self._floors = spec, floors
        lines = phases(spec).lines
        self._lines = lines[:: spec.samples_per_line]
        self._whole = WholeLines(lines, spec.samples_per_line, len(AXES))
        self._means: deque[Array] = deque(maxlen=TYPICAL_LINES)

    def add(self, drive: Trace, measured: Trace) -> Iterator[LineResidual]:
        """Take the next run of samples, the same of both; yield the lines that it makes whole.

        Raises BeyondRangeError where the drive leaves the model's identified range.
        """
        self._state, predicted = self._prediction.advance(self._state, drive)
        residual = np.stack([measured.axis(name) - predicted.axis(name) for name in AXES])
        for number, line in self._whole.add(drive.first_sample, residual):
            self._means.append(line.mean(axis=1))
            x, y = (self._judged(name, line[i], i) for i, name in enumerate(AXES))
            yield LineResidual(number, self._lines[number], x, y)

    def _judged(self, axis: str, residual: Array, row: int) -> AxisResidual:
        floor, about = self._floors[axis], residual - residual.mean()
        vibrating = np.array(floor.edges[:-1]) >= VIBRATING
        expected = np.where(vibrating, SHARP_TURN, 1.0) * floor.rms
        ratio = rms_by_band(residual, floor.edges, self._spec.sample_period) / expected
        loudest = int(np.argmax(ratio))
        within = float(ratio[loudest]), (floor.edges[loudest], floor.edges[loudest + 1])
        normalised_residual, band = max(within, self._between_lines(floor, row))
        return AxisResidual(
            float(about.std()), float(np.abs(about).max()), normalised_residual, band
        )

    def _between_lines(self, floor: DetectionLimit, row: int) -> tuple[float, tuple[float, float]]:
        """How far the lines' means spread, over the floor below the rate at which they come."""
        highest = 0.5 * self._spec.line_rate
        slow = np.array(floor.edges[:-1]) < highest
        spread = np.std([mean[row] for mean in self._means])
        return float(spread / np.linalg.norm(floor.rms[slow])), (0.0, highest)


ALARM_RATIO = 5.0
"""Residual over its floor above which a line is suspect.

The floor is that of a whole record; on a single line of a healthy scanner a band comes up to some
three times its floor.
"""
CALM_RATIO = 0.8
"""Share of that up to which a line is calm."""
LINES = 3
"""Suspect lines in a row that make an alarm, and calm ones that end it."""


@frozen
class ResidualAlarm:
    """A line by which the residual of an axis began to exceed its limit, or ceased to."""

    axis: str
    line: int
    residual: AxisResidual
    raised: bool


@define
class _AxisWatch:
    """One axis: its alarm, if one stands, and the lines in a row that contradict its state."""

    suspect: float
    lines: int
    alarm: ResidualAlarm | None = None
    _against: int = 0

    def changed(self, axis: str, line: LineResidual) -> ResidualAlarm | None:
        """Take a line; return the alarm that it raises or ends."""
        normalised_residual = line.axis(axis).normalised_residual
        contradicts = (
            normalised_residual <= CALM_RATIO * self.suspect
            if self.alarm
            else normalised_residual > self.suspect
        )
        self._against = self._against + 1 if contradicts else 0
        if self._against < self.lines:
            return None
        self._against = 0
        change = ResidualAlarm(axis, line.line, line.axis(axis), raised=not self.alarm)
        self.alarm = change if change.raised else None
        return change


class ResidualWatch:
    """Follows the lines of a scan; one noisy line is no alarm."""

    def __init__(self, suspect: float = ALARM_RATIO, lines: int = LINES) -> None:
        self._axes = {name: _AxisWatch(suspect, lines) for name in AXES}

    @property
    def alarms(self) -> list[ResidualAlarm]:
        """The alarms that stand."""
        return [axis.alarm for axis in self._axes.values() if axis.alarm]

    def news(self, line: LineResidual) -> list[ResidualAlarm]:
        """Take a line; return the alarms, axis by axis, that it raises or ends."""
        changes = [axis.changed(name, line) for name, axis in self._axes.items()]
        return [change for change in changes if change]
