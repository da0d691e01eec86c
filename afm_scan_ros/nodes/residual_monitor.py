"""Node: monitors the residual of a scan, and raises an alarm above the detection limit."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.diagnosis.monitor import (
    ALARM_RATIO,
    LINES,
    LineResidual,
    LineResiduals,
    ResidualAlarm,
    ResidualWatch,
    expected_limits,
)
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.learning.adaptation import EXPECTED, Adaptation, AxisState
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.streams import Aligner, LineError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.nodes.block_consumer import StreamReader, min_subscriptions, spec_of
from afm_scan_ros.nodes.messages import tracking_message
from afm_scan_ros.nodes.parameters import ADAPTATION, MODEL_FILE, NodeParameter, model_of
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, MODEL_RESIDUAL, NodeTopic


class ResidualMonitor(StreamReader):
    """Predicts the displacement from the drive; an alarm is the reason in ``node_state``.

    The scan continues with an alarm, and the state stays ``running``.
    """

    NAME = "residual_monitor"
    PARAMETERS = (
        MODEL_FILE,
        NodeParameter(
            "alarm",
            ALARM_RATIO,
            "Residual over model discrepancy that makes a line suspect",
            low=1.0,
        ),
        NodeParameter("alarm_lines", LINES, "Suspect lines in a row that raise the alarm", low=1),
        *ADAPTATION,
        min_subscriptions(0),
    )

    def __init__(self) -> None:
        super().__init__()
        self._model = model_of(self.settings)
        self._aligner = Aligner((DRIVE.name, ACHIEVED.name))
        self._watch = ResidualWatch(self.settings["alarm"], self.settings["alarm_lines"])
        self._residuals: LineResiduals | None = None
        self._adaptation: Adaptation | None = None
        self._alarm = ""
        self.write(MODEL_RESIDUAL, self.settings["min_subscriptions"])
        self.read([DRIVE, ACHIEVED])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Compute the places of the lines and their detection limit."""
        spec = spec_of(info)
        if info.model_hash != model_hash(self._model):
            self.get_logger().warning(
                "this scan is compensated with another model than the monitor compares with"
            )
        yield "computing the expected residual"
        silence = Trace(0, info.sample_period, np.zeros(2), np.zeros(2))
        predict(self._model, silence)  # compiled now, not while others wait
        self._residuals = LineResiduals(self._model, spec, expected_limits(self._model, spec))
        if self.settings["adapt"]:
            constant = self.settings["adapt_time_constant_s"]
            self._adaptation = Adaptation(self._model, spec, constant)

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - lines end by themselves
        """Publish the residuals of the lines that a block completes, and their alarms."""
        self._aligner.add(topic.name, block)
        for drive, measured in self._aligner.ready():
            for line in self._lines(drive, measured):
                self.publish(MODEL_RESIDUAL, tracking_message(self.scan, _figures(line)))
                for change in self._watch.news(line):
                    self.announce(_text(change), "; ".join(map(_text, self._watch.alarms)))
            self._track(drive, measured)

    def _track(self, drive: Trace, measured: Trace) -> None:
        """State what adaptation finds changed, while anything can be predicted."""
        if self._adaptation is None or self._residuals is None:
            return
        before = dict(self._adaptation.states)
        for _ in self._adaptation.add(drive, measured):
            for sentence, expected in _changes(before, self._adaptation.states):
                self.get_logger().info(sentence)
                if not expected:
                    self.go(RUNNING, sentence)
            before = dict(self._adaptation.states)

    def go(self, state: str, reason: str = "") -> None:
        """Enter a state; while nothing else is to be said, an alarm that stands is its reason."""
        super().go(state, reason or self._alarm)

    def announce(self, news: str, alarm: str) -> None:
        """Log new alarms, and publish the active alarm, if any, in the node's state."""
        if alarm:
            self.get_logger().warning(news)
        else:  # a place that logs keeps its severity: rclpy refuses another one there
            self.get_logger().info(news)
        self._alarm = alarm
        self.go(RUNNING, news)

    def _lines(self, drive: Trace, measured: Trace) -> list[LineResidual]:
        """Return the lines that are whole; none any more once nothing can be predicted."""
        if self._residuals is None:
            return []
        try:
            return list(self._residuals.add(drive, measured))
        except BeyondRangeError as error:
            self._residuals = None
            first = drive.first_sample + error.sample
            why = f"nothing can be predicted from sample {first} on: {error}"
            self.announce(why, why)
            return []


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


def _changes(
    before: Mapping[str, AxisState], after: Mapping[str, AxisState]
) -> Iterator[tuple[str, bool]]:
    """Yield a sentence for each parameter of which something else is known than before.

    And whether this is to be expected of a scanner that has not changed.
    """
    for axis, state in after.items():
        for name, finding in state.findings.items():
            old = before[axis].findings.get(name)
            if old is None or old.outcome is not finding.outcome:
                value, known = getattr(state.shift, name), finding.outcome.value
                sentence = f"{axis}: by line {state.lines - 1} the {name} is {known}: {value:.4g}"
                yield sentence, finding.outcome in EXPECTED


def _figures(line: LineResidual) -> LineError:
    x, y = line.x, line.y
    return LineError(line.line, line.first_sample, x.rms, y.rms, x.largest, y.largest)
