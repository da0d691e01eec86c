"""Compares a scan with the model while it runs: the residual of each line, alarms, changes."""

from collections.abc import Iterator, Mapping

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
from afm_scan_ros.core.online.adaptation import EXPECTED, Adaptation, AxisState
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


class ScanMonitor:
    """Takes the blocks of one scan, drive (V) and achieved displacement (m).

    ``adaptation`` tracks what changes, if it is to be tracked. Once the drive leaves the model's
    identified range, nothing more can be predicted. Raises InputError where the model states no
    model discrepancy. Its loops are compiled when it is made, not while others wait.
    """

    def __init__(
        self,
        model: ScannerModel,
        spec: ScanSpec,
        watch: ResidualWatch,
        adaptation: Adaptation | None = None,
    ) -> None:
        predict(model, Trace(0, spec.sample_period, np.zeros(2), np.zeros(2)))
        self._residuals = LineResiduals(model, spec, expected_limits(model, spec))
        self._watch, self._adaptation = watch, adaptation
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
        yield from self._tracked(drive, measured)

    def _tracked(self, drive: Trace, measured: Trace) -> Iterator[ScanNews]:
        if self._adaptation is None:
            return
        before = dict(self._adaptation.states)
        for _ in self._adaptation.add(drive, measured):
            yield from _changes(before, self._adaptation.states)
            before = dict(self._adaptation.states)


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


def _changes(before: Mapping[str, AxisState], after: Mapping[str, AxisState]) -> Iterator[ScanNews]:
    """Yield a sentence for each parameter of which something else is known than before."""
    for axis, state in after.items():
        for name, finding in state.findings.items():
            old = before[axis].findings.get(name)
            if old is None or old.outcome is not finding.outcome:
                value, known = getattr(state.shift, name), finding.outcome.value
                sentence = f"{axis}: by line {state.lines - 1} the {name} is {known}: {value:.4g}"
                yield ScanNews(sentence, expected=finding.outcome in EXPECTED)


def _figures(line: LineResidual) -> LineError:
    x, y = line.x, line.y
    return LineError(line.line, line.first_sample, x.rms, y.rms, x.largest, y.largest)
