"""The residual of a scan line by line, as it is scanned, beside what is known of the model's error.

Displacement is relative, so each line's mean is left out; but a mean that moves from line to line
is a residual too, below the line rate: drift shows in nothing else.
"""

from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.floor import VIBRATING, Floor, floor_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import Prediction
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.core.whole_lines import WholeLines

MEMORY = 64
"""Lines whose means are compared."""
SHARP = 3.0
"""Times the floor that vibrations of a healthy scanner reach on a line, and nothing slower.

The known error is that of a record spread over all frequencies; a harmonic of the line rate may
meet a mode that the model lacks.
"""
FORESEEN = 64_000
"""Samples of lines, two at least, from which the floor is told before they are scanned."""


@frozen
class AxisResidual:
    """Residual of one axis on one line, its mean left out: rms and largest size, m.

    ``excess`` is its rms over what is to be expected, in the band (Hz) where that is largest.
    """

    rms: float
    largest: float
    excess: float
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


def foreseen_floors(model: ScannerModel, spec: ScanSpec) -> dict[str, Floor]:
    """Floor of each axis of a scan that follows what is desired.

    Raises InputError where the model states no known error.
    """
    lines = max(2, FORESEEN // spec.samples_per_line)
    first = evolve(spec, lines=min(spec.lines, lines))
    path = desired(first, 0, phases(first).total)
    floors = {}
    for name in AXES:
        known = model.axis(name).known_errors
        if not known:
            raise InputError(
                f"the model of axis {name} states no known_error, so no residual is too large:"
                " identify it anew, with its validation record, or scan unwatched"
            )
        floors[name] = floor_of(known, path.axis(name), spec.sample_period)
    return floors


class LineResiduals:
    """Follows drive and measured displacement, and gives up each line once it is whole.

    Keeps one line and the means of some, however long the scan is.
    """

    def __init__(self, model: ScannerModel, spec: ScanSpec, floors: Mapping[str, Floor]) -> None:
        self._prediction = Prediction(model, spec.sample_period)
        self._state = self._prediction.at_rest()
        self._spec, self._floors = spec, floors
        lines = phases(spec).lines
        self._lines = lines[:: spec.samples_per_line]
        self._whole = WholeLines(lines, spec.samples_per_line, len(AXES))
        self._means: deque[Array] = deque(maxlen=MEMORY)

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
        expected = np.where(vibrating, SHARP, 1.0) * floor.rms
        ratio = rms_by_band(residual, floor.edges, self._spec.sample_period) / expected
        loudest = int(np.argmax(ratio))
        within = float(ratio[loudest]), (floor.edges[loudest], floor.edges[loudest + 1])
        excess, band = max(within, self._between_lines(floor, row))
        return AxisResidual(float(about.std()), float(np.abs(about).max()), excess, band)

    def _between_lines(self, floor: Floor, row: int) -> tuple[float, tuple[float, float]]:
        """How far the lines' means spread, over the floor below the rate at which they come."""
        highest = 0.5 * self._spec.line_rate
        slow = np.array(floor.edges[:-1]) < highest
        spread = np.std([mean[row] for mean in self._means])
        return float(spread / np.linalg.norm(floor.rms[slow])), (0.0, highest)
