"""What a node knows of the others of its scan: their states, their silence, their progress."""

from collections.abc import Iterable, Sequence

from attrs import evolve, frozen

from afm_scan_ros.core.scan_info import ScanInfo

READY, RUNNING, DONE, FAILED = "ready", "running", "done", "failed"


@frozen
class Report:
    """The last state of one node.

    ``heard`` is when it was received, ``advanced`` when its progress was last seen to grow (s, any
    steady clock).
    """

    node: str
    scan_id: str
    state: str
    next_sample: int
    reason: str
    heard: float
    advanced: float = 0.0


class Peers:
    """The nodes of one scan, in the order of the data flow, the source first."""

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self.scan_id = ""
        self._order: tuple[str, ...] = ()
        self._reports: dict[str, Report] = {}
        self._since = self._began = 0.0

    def follow(self, order: Sequence[str], own: str, scan_id: str, now: float) -> None:
        """Begin to watch the nodes that take part in a scan; ``own`` is the watching one."""
        self._order, self.scan_id, self._since = tuple(order), scan_id, now
        self._began = 0.0
        self.names = tuple(name for name in order if name != own)

    def begin(self, now: float) -> None:
        """Note that the source, which is this node, has begun to send."""
        self._began = now

    def listen_anew(self, now: float) -> None:
        """Count silence and standstill from ``now``, since earlier messages may still be queued."""
        self._since = now

    def hear(self, report: Report) -> None:
        """Store a node's state; a node whose progress falls has restarted or exists twice."""
        before = self.of_scan(report.node)
        report = evolve(report, advanced=report.heard)
        if before is not None and before.state == FAILED:
            return  # it stays so: of two of one name the other goes on to say that it runs
        if before is not None and _falls_back(before, report):
            report = evolve(
                before, state=FAILED, reason="restarted, or another scan began in this ROS domain"
            )
        elif before is not None and report.next_sample == before.next_sample:
            report = evolve(report, advanced=before.advanced)
        if report.state == RUNNING and self._order[:1] == (report.node,) and not self._began:
            self._began = report.heard
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
        """Return the sample before which all other nodes are finished with everything."""
        reports = [self.of_scan(name) for name in self.names]
        return min((report.next_sample if report else 0 for report in reports), default=0)

    def failure(self) -> str | None:
        """Name the first node that failed, in this scan or before it knew one, and say why."""
        failed = filter(self._has_failed, self.names)
        return next((f"{name} failed: {self._reports[name].reason}" for name in failed), None)

    def silence(self, names: Iterable[str], now: float, timeout: float) -> str | None:
        """Name the first of the nodes that has not been heard for longer than ``timeout`` s.

        One that was never heard is not silent: it may still start.
        """
        heard = {name: self._reports[name].heard for name in names if name in self._reports}
        silent = (name for name, last in heard.items() if now - max(self._since, last) > timeout)
        return next((f"{name} has been silent for {timeout:g} s" for name in silent), None)

    def standstill(
        self, own: Report, info: ScanInfo, now: float, timeout: float, pause: float
    ) -> str | None:
        """Name the node at which samples stand still, where the slowest has for ``timeout`` s.

        ``own`` is the watching node's state. A node works that has advanced within ``pause`` s.
        """
        known = [own if name == own.node else self.of_scan(name) for name in self._order]
        reports = [each for each in known if each is not None]
        if len(reports) < len(self._order) or reports[0].state != RUNNING:
            return None
        began = max(self._since, self._began)
        stands = {
            each.node: now - (began if each.state == READY else max(began, each.advanced))
            for each in reports
        }
        going = [each for each in reports[1:] if each.state != DONE]
        least = min((each.next_sample for each in going), default=0)
        if all(stands[each.node] <= timeout for each in going if each.next_sample == least):
            return None
        source = reports[0]
        fills = stands[source.node] <= pause and source.next_sample - least <= info.window // 2
        if fills and all(each.state == READY for each in going if each.next_sample == least):
            return None  # the preview: nothing has moved yet
        silent = {e.node: now - max(began, e.heard) for e in reports if e.node != own.node}
        longest = max(silent, key=lambda name: silent[name])
        if silent[longest] > 0.5 * timeout:  # for which the source may have paused
            return f"{longest} has been silent for {silent[longest]:.2g} s"
        culprit = _culprit(reports, info, [name for name in stands if stands[name] > pause])
        reason = f" ({culprit.reason})" if culprit.reason else ""
        return (
            f"{culprit.node} has finished no sample for {timeout:.3g} s: it stands at sample"
            f" {culprit.next_sample}{reason}"
        )

    def _has_failed(self, name: str) -> bool:
        report = self._reports.get(name)
        if report is None or report.state != FAILED:
            return False
        return report.scan_id in ("", self.scan_id)

    def _described(self, name: str) -> str:
        report = self._reports.get(name)
        if report is None:
            return f"{name} (no state received)"
        return f"{name} ({report.reason or report.state})"


def _culprit(reports: Sequence[Report], info: ScanInfo, standing: Sequence[str]) -> Report:
    """Return the one of the ``standing`` nodes for which the samples wait.

    The source stands by itself where it could send: it may be a window ahead of the slowest. Others
    are behind those before them in the data flow; those after the culprit are so too, but by no
    more than the preview and the latency between them, for which nodes demand half a window. After
    the scan's last sample nobody keeps any, so that the first who is behind has stopped.
    """
    source, *others = reports
    waiting = [each for each in others if each.node in standing and each.state != DONE]
    slowest = min(waiting, key=lambda each: each.next_sample)
    if source.next_sample == info.total_samples:
        return next((each for each in waiting if _lag(each, reports)), slowest)
    if source.node in standing and source.next_sample - slowest.next_sample < info.window // 2:
        return source
    return max(waiting, key=lambda each: _lag(each, reports))


def _lag(report: Report, reports: Sequence[Report]) -> int:
    """Return how far a node is behind the slowest of those before it in the data flow."""
    before = reports[: reports.index(report)]
    return min(each.next_sample for each in before) - report.next_sample


def _falls_back(before: Report, report: Report) -> bool:
    within = before.state != READY
    return within and (report.state == READY or report.next_sample < before.next_sample)
