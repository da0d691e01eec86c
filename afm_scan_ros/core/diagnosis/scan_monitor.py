"""Compares a scan with the model while it runs: the residual of each line, alarms, changes."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np
from attrs import frozen

from afm_scan_ros.core.diagnosis.monitor import (
    LineResidual,
    LineResiduals,
    ResidualAlarm,
    ResidualWatch,
    expected_limits,
)
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.streams import ACHIEVED, DRIVE, Aligner, LineError
from afm_scan_ros.core.types import Trace


@frozen
class ScanNews:
    """A sentence on the scanner; one that is ``expected`` is true of a healthy scanner too.

    ``alarm`` says whether an alarm is active since.
    """

    text: str
    alarm: bool = False
    expected: bool = False


Tracker: TypeAlias = Callable[[Trace, Trace], Iterator[ScanNews]]
"""Takes the next run of samples, drive (V) and achieved displacement (m), and says what is new."""


class ScanMonitor:
    """Takes the blocks of one scan, drive (V) and achieved displacement (m).

    ``trackers`` look for what else changes. Once the drive leaves the model's identified range,
    nothing more can be predicted. Raises InputError where the model states no
    model discrepancy. Its loops are compiled when it is made, not while others wait.
    """

    def __init__(
        self,
        model: ScannerModel,
        spec: ScanSpec,
        watch: ResidualWatch,
        trackers: Sequence[Tracker] = (),
    ) -> None:
        predict(model, Trace(0, spec.sample_period, np.zeros(2), np.zeros(2)))
        self._residuals = LineResiduals(model, spec, expected_limits(model, spec))
        self._watch, self._trackers = watch, trackers
        self._aligner = Aligner((DRIVE, ACHIEVED))
        self._lost = ""

    @property
    def alarm(self) -> str:
        """The active alarms; nothing where there is none."""
        return self._lost or "; ".join(map(_text, self._watch.alarms))

    def add(self, name: str, block: Trace) -> Iterator[LineError | ScanNews]:
        """Take a block of one of the two topics; yield the lines that it makes whole, and news."""
        self._aligner.add(name, block)
        for drive, measured in self._aligner.ready():
            if not self._lost:
                yield from self._judged(drive, measured)

    def _judged(self, drive: Trace, measured: Trace) -> Iterator[LineError | ScanNews]:
        try:
            lines = list(self._residuals.add(drive, measured))
        except BeyondRangeError as error:
            first = drive.first_sample + error.sample
            self._lost = f"nothing can be predicted from sample {first} on: {error}"
            yield ScanNews(self._lost, alarm=True)
            return
        for line in lines:
            yield _figures(line)
            for change in self._watch.news(line):
                yield ScanNews(_text(change), alarm=bool(self._watch.alarms))
        for track in self._trackers:
            yield from track(drive, measured)


def _text(alarm: ResidualAlarm) -> str:
    """Say where an alarm began, or that it has ended."""
    found, (low, high) = alarm.residual, alarm.residual.band
    if not alarm.raised:
        return f"{alarm.axis}: at line {alarm.line} the residual is within the model discrepancy"
    return (
        f"{alarm.axis}: at line {alarm.line} the residual is {1e9 * found.rms:.3g} nm rms,"
        f" {found.normalised_residual:.3g} times the model discrepancy from {low:g} to {high:g}"
        " Hz. Diagnose this scan's bag"
    )


def _figures(line: LineResidual) -> LineError:
    x, y = line.x, line.y
    return LineError(line.line, line.first_sample, x.rms, y.rms, x.largest, y.largest)
