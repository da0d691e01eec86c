"""The topics and their quality of service, and the states that the nodes of a scan publish."""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from re import sub

from attrs import evolve, frozen

from afm_scan_ros.ros import (
    DiagnosticArray,
    DiagnosticStatus,
    DisplacementBlock,
    DurabilityPolicy,
    HistoryPolicy,
    Image,
    KeyValue,
    Message,
    MonitorSample,
    Node,
    NodeState,
    QoSProfile,
    RCLError,
    ReliabilityPolicy,
    ScanInfo,
    TrackingError,
    VoltageBlock,
)


def _latched(depth: int) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


# A keep-last reader loses blocks silently, even where delivery is reliable.
_EVERYTHING = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)


# Viewers alone read it: none of them can make a node wait.
_FOR_VIEWERS = QoSProfile(
    depth=200,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


@frozen(eq=False)
class NodeTopic:
    """A topic by its relative name, so that namespaces and remaps work."""

    name: str
    kind: type[Message]
    writer: QoSProfile
    reader: QoSProfile


def _blocks(name: str, kind: type[Message]) -> NodeTopic:
    return NodeTopic(name, kind, _EVERYTHING, _EVERYTHING)


DESIRED = _blocks("desired_displacement", DisplacementBlock)
DRIVE = _blocks("drive_voltage", VoltageBlock)
ACHIEVED = _blocks("achieved_displacement", DisplacementBlock)
TRUE = _blocks("true_displacement", DisplacementBlock)
TRACKING_ERROR = _blocks("tracking_error", TrackingError)
MODEL_RESIDUAL = _blocks("model_residual", TrackingError)
MONITOR = NodeTopic("monitor", MonitorSample, _FOR_VIEWERS, _FOR_VIEWERS)
TRACE_IMAGE = NodeTopic("scan_image/trace", Image, _latched(1), _latched(1))
RETRACE_IMAGE = NodeTopic("scan_image/retrace", Image, _latched(1), _latched(1))
SCAN_INFO = NodeTopic("scan_info", ScanInfo, _latched(1), _latched(1))
# Every node writes its own last state; a reader keeps those of many.
NODE_STATE = NodeTopic("node_state", NodeState, _latched(1), _latched(100))
# The last status is all that counts, so no reader can make a node wait.
_LAST = QoSProfile(depth=1)
DIAGNOSTICS = NodeTopic("/diagnostics", DiagnosticArray, _LAST, QoSProfile(depth=100))

BLOCKS = {topic.name: topic for topic in (DESIRED, DRIVE, ACHIEVED, TRUE)}


READY, RUNNING, DONE, FAILED = "ready", "running", "done", "failed"


@frozen
class Report:
    """The last state of one node, and when it was received (s, any steady clock)."""

    node: str
    scan_id: str
    state: str
    next_sample: int
    reason: str
    heard: float


class Peers:
    """The other nodes of one scan, in the order of the data flow, the source first."""

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self.scan_id = ""
        self._reports: dict[str, Report] = {}
        self._since = 0.0

    def follow(self, names: Iterable[str], scan_id: str, now: float) -> None:
        """Begin to watch the nodes that take part in a scan."""
        self.names, self.scan_id, self._since = tuple(names), scan_id, now

    def listen_anew(self, now: float) -> None:
        """Count silence from ``now``, since earlier messages may still be queued."""
        self._since = now

    def hear(self, report: Report) -> None:
        """Store a node's state; a node whose progress falls has restarted or exists twice."""
        before = self.of_scan(report.node)
        if before is not None and before.state == FAILED:
            return  # it stays so: of two of one name the other goes on to say that it runs
        if before is not None and _falls_back(before, report):
            report = evolve(before, state=FAILED, reason="restarted during the scan")
        self._reports[report.node] = report

    def of_scan(self, name: str) -> Report | None:
        """Return a node's last state in this scan; None if it has not reported one."""
        report = self._reports.get(name)
        return report if report is not None and report.scan_id == self.scan_id else None

    def state(self, name: str) -> str | None:
        """Return how a node stands with this scan."""
        report = self.of_scan(name)
        return report.state if report else None

    def lacking(self, *states: str) -> list[str]:
        """Describe each node that is in none of the states, with what it waits for."""
        waiting = [name for name in self.names if self.state(name) not in states]
        return [self._described(name) for name in waiting]

    def unheard_since(self, moment: float) -> list[str]:
        """Return the nodes that have said nothing after a moment, on the clock of ``heard``."""
        last = {name: report.heard for name, report in self._reports.items()}
        return [name for name in self.names if last.get(name, moment) <= moment]

    def slowest(self) -> int:
        """Return the sample before which all nodes are finished with everything."""
        reports = [self.of_scan(name) for name in self.names]
        return min((report.next_sample if report else 0 for report in reports), default=0)

    def failure(self) -> str | None:
        """Name the first node that failed, in this scan or before it knew one, and say why."""
        failed = filter(self._has_failed, self.names)
        return next((f"{name} failed: {self._reports[name].reason}" for name in failed), None)

    def silence(self, names: Iterable[str], now: float, timeout: float) -> str | None:
        """Name the first of the nodes that has not been heard for longer than ``timeout`` s."""
        silent = (name for name in names if now - self._last_heard(name) > timeout)
        return next((f"{name} has been silent for {timeout:g} s" for name in silent), None)

    def _has_failed(self, name: str) -> bool:
        report = self._reports.get(name)
        if report is None or report.state != FAILED:
            return False
        return report.scan_id in ("", self.scan_id)

    def _last_heard(self, name: str) -> float:
        report = self._reports.get(name)
        return max(self._since, report.heard) if report else self._since

    def _described(self, name: str) -> str:
        report = self._reports.get(name)
        if report is None:
            return f"{name} (no state received)"
        return f"{name} ({report.reason or report.state})"


def _falls_back(before: Report, report: Report) -> bool:
    within = before.state != READY
    return within and (report.state == READY or report.next_sample < before.next_sample)


PERIOD = 1.0
"""Seconds between two messages while nothing changes."""


class Diagnostics:
    """The status of one node: an error where it failed, a warning where it runs with a reason."""

    def __init__(self, node: Node) -> None:
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: scan"
        self._publisher = node.create_publisher(
            DIAGNOSTICS.kind, DIAGNOSTICS.name, DIAGNOSTICS.writer
        )
        self._words, self._next = "", 0.0

    def publish(self, state: str, reason: str, figures: Callable[[], Mapping[str, object]]) -> None:
        """Publish the status if more than a number has changed, or the last one is a period old.

        A status that DDS refuses is dropped.
        """
        text, now = f"{state}: {reason}" if reason else state, time.monotonic()
        words = sub(r"\d+", "", text)
        if words == self._words and now < self._next:
            return
        self._words, self._next = words, now + PERIOD
        message = DiagnosticArray()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
        bad = DiagnosticStatus.ERROR if state == FAILED else DiagnosticStatus.WARN
        status = DiagnosticStatus(
            level=bad if reason and state in (FAILED, RUNNING) else DiagnosticStatus.OK,
            name=self._name,
            message=text,
            values=[KeyValue(key=key, value=str(value)) for key, value in figures().items()],
        )
        message.status = [status]
        with suppress(RCLError):
            self._publisher.publish(message)
