"""Monitors the residual of a scan line by line, against the detection limit.

Displacement is relative, so the mean of each line is removed. The spread of these means is a
residual below the line rate and shows drift. An alarm is raised after several lines in a row
above the limit, and ends after as many below it.
"""

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np
from attrs import define, evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit, detection_limit
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import Prediction
from afm_scan_ros.core.streams import WholeLines
from afm_scan_ros.core.trajectory import desired, phases
from afm_scan_ros.core.types import AXES, Array, Trace

TYPICAL_LINES = 64
"""Lines whose means are compared."""
SHARP_TURN = 3.0
"""Factor on the detection limit in the bands of vibration, for a single line.

The model discrepancy is an average over all frequencies of a band; a harmonic of the line rate may
lie at an unmodelled mode.
"""
DETECTION_LIMITS = 64_000
"""Samples of the desired lines, two lines at least, that give the limit before the scan."""


@frozen
class AxisResidual:
    """Residual of one axis on one line, its mean left out: rms and largest size, m.

    ``normalised_residual`` is its rms over the detection limit, in the band (Hz) where this ratio
    is largest.
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
    """Detection limit of each axis for a scan that follows the desired displacement.

    Raises InputError where the model states no model discrepancy.
    """
    lines = max(2, DETECTION_LIMITS // spec.samples_per_line)
    first = evolve(spec, lines=min(spec.lines, lines))
    path = desired(first, 0, phases(first).total)
    limits = {}
    for name in AXES:
        known = model.axis(name).model_discrepancies
        if not known:
            raise InputError(
                f"the model of axis {name} states no model_discrepancy, so no residual is too"
                " large: identify it anew, with its validation record, or scan unwatched"
            )
        resonance = resonance_of(model.axis(name).vibration, spec.sample_period)
        limits[name] = detection_limit(
            known, path.axis(name), spec.sample_period, resonance, model.axis(name).spread
        )
    return limits


class LineResiduals:
    """Predicts the displacement from the drive, and yields the residual of each complete line.

    Memory does not grow with the scan: it holds one line and the means of the last lines.
    """

    def __init__(
        self, model: ScannerModel, spec: ScanSpec, limits: Mapping[str, DetectionLimit]
    ) -> None:
        self._prediction = Prediction(model, spec.sample_period)
        self._state = self._prediction.at_rest()
        self._spec, self._limits = spec, limits
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
        limit, about = self._limits[axis], residual - residual.mean()
        expected = np.where(limit.vibrating, SHARP_TURN, 1.0) * limit.rms
        ratio = rms_by_band(residual, limit.edges, self._spec.sample_period) / expected
        loudest = int(np.argmax(ratio))
        within = float(ratio[loudest]), (limit.edges[loudest], limit.edges[loudest + 1])
        normalised_residual, band = max(within, self._between_lines(limit, row))
        return AxisResidual(
            float(about.std()), float(np.abs(about).max()), normalised_residual, band
        )

    def _between_lines(self, limit: DetectionLimit, row: int) -> tuple[float, tuple[float, float]]:
        """Spread of the lines' means over the detection limit below half the line rate."""
        highest = 0.5 * self._spec.line_rate
        slow = np.array(limit.edges[:-1]) < highest
        spread = np.std([mean[row] for mean in self._means])
        return float(spread / np.linalg.norm(limit.rms[slow])), (0.0, highest)


ALARM_RATIO = 5.0
"""Residual over its detection limit above which a line is suspect.

The limit is that of a whole record. On single lines of a healthy scanner a band reaches up to
about three times its limit.
"""
CALM_RATIO = 0.8
"""Share of that ratio below which a line is not suspect."""
LINES = 3
"""Suspect lines in a row that raise an alarm, and lines in a row that end it."""


@frozen
class ResidualAlarm:
    """The line at which an alarm of an axis is raised or ends."""

    axis: str
    line: int
    residual: AxisResidual
    raised: bool


@define
class _AxisWatch:
    """One axis: its active alarm, if any, and the lines in a row that contradict its state."""

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
    """Raises and ends alarms from the lines of a scan; a single suspect line raises none."""

    def __init__(self, suspect: float = ALARM_RATIO, lines: int = LINES) -> None:
        self._axes = {name: _AxisWatch(suspect, lines) for name in AXES}

    @property
    def alarms(self) -> list[ResidualAlarm]:
        """The active alarms."""
        return [axis.alarm for axis in self._axes.values() if axis.alarm]

    def news(self, line: LineResidual) -> list[ResidualAlarm]:
        """Take a line; return the alarms, axis by axis, that it raises or ends."""
        changes = [axis.changed(name, line) for name, axis in self._axes.items()]
        return [change for change in changes if change]
