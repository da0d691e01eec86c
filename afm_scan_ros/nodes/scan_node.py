"""Base of all nodes of a scan: its state, the watch over the others, and its end."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from re import sub
from threading import Event, RLock, Thread

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.utilities import timeout_sec_to_nsec

from afm_scan_ros.bag.scan_info import decode_block, encode_block
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.safety import SafetySettings
from afm_scan_ros.nodes.declare import declare
from afm_scan_ros.nodes.diagnostics import Diagnostics
from afm_scan_ros.nodes.messages import Message, state_message
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.peers import DONE, FAILED, READY, RUNNING, Peers, Report
from afm_scan_ros.nodes.topics import BLOCKS, NODE_STATE, NodeTopic

_UNNAMED = "_NODE_NAME_UNKNOWN_"
"""What rmw calls a node until its name is known."""

COMMON = (
    NodeParameter(
        "liveness_timeout_s", 0.8, "Time without a sign of a node until the scan stops", low=0.2
    ),
    NodeParameter(
        "startup_timeout_s", 60.0, "Longest wait for the nodes of a scan to be ready", low=0.1
    ),
    NodeParameter(
        "progress_timeout_s",
        0.3,
        "Scan time in which the slowest node may finish no sample until the drive ramps down",
        low=0.2,
    ),
    NodeParameter("time_scale", 1.0, "Duration over scan time: 1 for real time", low=0.0),
    NodeParameter(
        "real_time",
        default=True,
        description="Whether samples have to advance by the clock; false in simulation",
    ),
)


class ScanNode(Node, ABC):
    """A node of a scan: ready, running, done or failed. All nodes watch each other.

    A subclass gives its parameters and does its work in callbacks and in ``step``. An exception in
    these fails the node, which publishes the reason.
    """

    NAME: str
    PARAMETERS: tuple[NodeParameter, ...] = ()
    safety = SafetySettings()

    def __init__(self) -> None:
        super().__init__(self.NAME)
        parameters = {each.name: each for each in (*COMMON, *self.PARAMETERS)}
        self.settings = declare(self, parameters.values())
        self.info: ScanInfo | None = None
        self.peers = Peers()
        self.state = READY
        self.reason = "waits for scan_info"
        self.next_sample = 0
        self.status = 0
        self.on_closed: Callable[[], None] = lambda: None
        self.ready = False
        self._reported = 0
        self._logged = ""
        self._next_watch = self._started = self._ticked = self._advanced = time.monotonic()
        self._all_heard_at = self._started
        self.calls = 0
        self.busy = 0.0
        self._leave_at: float | None = None
        self._reporting = RLock()
        self._ended = Event()
        self._heartbeat = Thread(target=self._beat, daemon=True)
        self._readers: list[tuple[Subscription, Callable[[Message, Mapping[str, int]], None]]] = []
        self._publishers_of: dict[str, dict[bytes, str]] = {}
        self._crowded_since = 0.0
        self._longest_block = 0.0
        self.inputs: list[str] = []
        self._state_publisher = self.create_publisher(
            NODE_STATE.kind, NODE_STATE.name, NODE_STATE.writer
        )
        self._diagnostics = Diagnostics(self)

    @classmethod
    def warm_up(cls) -> None:
        """Compute once what is slow the first time, before the node joins ROS."""
        info, rest = ScanInfo("", 0, "", 1.0, 1), Trace(0, 1.0, np.zeros(1), np.zeros(1))
        for topic in BLOCKS.values():
            decode_block(topic.type_name, encode_block(topic.type_name, info, rest, last=False))

    @property
    def scan(self) -> ScanInfo:
        """The scan that the node takes part in; raises ScanError before it knows one."""
        if self.info is None:
            raise ScanError(
                "a block came before scan_info: this node came late, or an earlier scan still runs"
            )
        return self.info

    @property
    def finished(self) -> bool:
        """Whether the node has said its last word, and long enough ago."""
        return self._leave_at is not None and time.monotonic() >= self._leave_at

    @property
    def leaving(self) -> bool:
        """Whether the node has ended its work, for better or worse."""
        return self._leave_at is not None

    @property
    def watch_is_due(self) -> bool:
        """Whether the next tick looks at the other nodes."""
        return time.monotonic() >= self._next_watch

    @abstractmethod
    def step(self) -> bool:
        """Do some work that no message asks for; return whether more of it could follow at once."""

    @abstractmethod
    def watched(self) -> tuple[str, ...]:
        """Return the nodes whose silence matters now."""

    def hear_others(self) -> None:
        """Begin to hear the others, by a reader made last: whoever is heard knows all of ours.

        DDS tells of readers in the order in which they were made. A thread reports from now on, so
        that a node is heard while a callback of its own computes: whether it works is seen by its
        progress.
        """
        self.subscribe(NODE_STATE, self._hear)
        reads, writes = (_named(each) for each in (self.subscriptions, self.publishers))
        name = self.get_fully_qualified_name()
        self.get_logger().info(f"{name} reads {reads}; it publishes {writes}")
        self._heartbeat.start()

    def subscribe(
        self, topic: NodeTopic, callback: Callable[[Message, int], object], *, raw: bool = False
    ) -> None:
        """Call back with each message of a topic, or with its bytes if ``raw``.

        And with its number among those of its publisher.
        """

        def called(message: Message, information: Mapping[str, int]) -> None:
            self.calls += 1
            began = time.monotonic()
            callback(message, information["publication_sequence_number"])
            self.busy += time.monotonic() - began

        made = self.create_subscription(topic.kind, topic.name, called, topic.reader, raw=raw)
        self._readers.append((made, called))

    def take_messages(self, seconds: float) -> bool:
        """Call back for messages that have arrived, for so long at most; return whether any had.

        An executor builds its set of waitables anew for each message, which takes several times as
        long as the message. Waiting and taking follow ``rclpy.wait_for_message``.
        """
        deadline, before = time.monotonic() + seconds, self.calls
        busy = True
        while busy and time.monotonic() < deadline:
            busy = False
            for subscription, callback in self._readers:
                with subscription.handle:
                    taken = subscription.handle.take_message(
                        subscription.msg_type, subscription.raw
                    )
                if taken is not None:
                    callback(*taken)
                    busy = True
        return self.calls != before

    def await_message(self, seconds: float) -> None:
        """Wait until a message has arrived, for so long at most."""
        counts = len(self._readers), 0, 0, 0, 0, 0
        waits = rclpy_implementation.WaitSet(*counts, self.context.handle)
        waits.clear_entities()
        for subscription, _ in self._readers:
            waits.add_subscription(subscription.handle)
        waits.wait(timeout_sec_to_nsec(seconds))

    def all_heard(self) -> None:
        """Note that no message that has arrived waits to be heard."""
        self._all_heard_at = time.monotonic()

    def silence(self, names: Iterable[str], now: float, timeout: float) -> str | None:
        """Name the first node that was silent for ``timeout`` s when all had been heard last.

        Before, its message may still wait in a queue. Where more arrives than can be heard, a node
        is silent after twice the time.
        """
        return self.peers.silence(names, max(self._all_heard_at, now - timeout), timeout)

    def tick(self) -> bool:
        """Watch, work, and report; return whether more work could follow at once."""
        now = time.monotonic()
        if now - self._ticked > self.safety.inattention:
            self.peers.listen_anew(now)
        self._ticked = now
        if now >= self._next_watch and not self.leaving:
            self._next_watch = now + self.safety.watch
            self.watch(now)
        return not self.leaving and self.step()

    def watch(self, now: float) -> None:
        """Raise ScanError where another node failed, fell silent, or publishes in our place.

        And where samples stand still while the scan runs.
        """
        patience = self.patience() if self.state == RUNNING else self.safety.silence_at_rest
        trouble = self.peers.failure() or self.silence(self.watched(), now, patience)
        if trouble is None and self.info is not None and self.state == READY:
            trouble = self._late(now)
        if trouble is None and self.info is not None and self.state == RUNNING:
            trouble = self.standstill(self.longest_standstill())
        if trouble:
            raise ScanError(trouble)
        self._watch_publishers(now)

    def patience(self) -> float:
        """Return how long (s) another node may be silent while the scan runs."""
        return float(self.settings["liveness_timeout_s"])

    def standstill(self, timeout: float) -> str | None:
        """Name the node at which the samples of a running scan have stood for ``timeout`` s."""
        own, pause = self._own_report(), self._longest_pause()
        return self.peers.standstill(own, self.scan, time.monotonic(), timeout, pause)

    def longest_standstill(self) -> float:
        """Return for how long (s) no progress of a node may be heard.

        A block is output meanwhile. The progress that was heard last is up to a heartbeat older
        than its message, so that this much less is waited for the next.
        """
        if not self.settings["real_time"]:
            return float(self.settings["liveness_timeout_s"])
        scale = max(1.0, float(self.settings["time_scale"]))
        timeout = float(self.settings["progress_timeout_s"] + self._longest_block)
        return scale * timeout - self.safety.heartbeat

    def _longest_pause(self) -> float:
        """Return how long (s) a node that works may seem to stand: a block, and two heartbeats."""
        if not self.settings["real_time"]:
            return 0.5 * self.longest_standstill()
        return (
            float(self.settings["time_scale"]) * self._longest_block + 2.0 * self.safety.heartbeat
        )

    def _own_report(self) -> Report:
        name, now = self.get_name(), time.monotonic()
        return Report(
            name, self.scan.scan_id, self.state, self.next_sample, self.reason, now, self._advanced
        )

    def begin(self, info: ScanInfo) -> None:
        """Begin to take part in a scan: watch the others that do."""
        self.info, self._started = info, time.monotonic()
        self.peers.follow(info.nodes, self.get_name(), info.scan_id, self._started)

    def listen_to(self, topic: NodeTopic) -> None:
        """Name a topic, read or written here, that one node alone is to publish."""
        self.inputs.append(self.resolve_topic_name(topic.name))

    def take_part(self, *, ready: bool) -> None:
        """Publish whether the node is ready for the scan."""
        if self.ready != ready:
            self.ready = ready
            self.report()

    def note_block(self, samples: int) -> None:
        """Note the size of a block, for which samples stand still before they advance."""
        self._longest_block = max(self._longest_block, samples * self.scan.sample_period)

    def go(self, state: str, reason: str = "") -> None:
        """Enter a state and publish it."""
        with self._reporting:
            self.state, self.reason = state, reason
            self.report()

    def figures(self) -> Mapping[str, object]:
        """Return further values of ``/diagnostics``, by name."""
        if self.info is None:
            return {}
        of_scan = {"scan_id": self.info.scan_id, "total_samples": self.info.total_samples}
        return of_scan | {"next_sample": self.next_sample}

    def advance_to(self, sample: int) -> None:
        """Record progress, and publish it before the source would wait for it."""
        if sample != self.next_sample:
            self._advanced = time.monotonic()
        self.next_sample = sample
        if self.info is not None and sample - self._reported >= self.info.window // 4:
            self.report()

    def fail(self, error: Exception) -> None:
        """End with an error: publish it, and leave.

        The status is 2 for InputError, 3 for ScanError, 1 for what is a fault of the program.
        """
        if self.leaving:
            return
        self.status = (
            2 if isinstance(error, InputError) else 3 if isinstance(error, ScanError) else 1
        )
        reason = str(error) if self.status > 1 else f"{type(error).__name__}: {error}"
        try:
            reason = self.settle(reason)  # before the heartbeat says that the node has failed
        finally:
            try:
                self.go(FAILED, reason)
            finally:
                self.leave()

    def settle(self, reason: str) -> str:
        """Bring the node's outputs to a safe state after a failure; return a remark on it."""
        return reason

    def leave(self) -> None:
        """End the work; only the last state is still published."""
        self._leave_at = time.monotonic() + self.safety.last_word

    def interrupt(self, signal: str) -> None:
        """End because of a signal; an unfinished scan has then failed."""
        if self.info is None or self.state == DONE:
            self.leave()
            self.get_logger().info(f"ends: interrupted by {signal}")
        else:
            self.fail(ScanError(f"interrupted by {signal} at sample {self.next_sample}"))

    def report(self) -> None:
        """Publish node_state; from one thread at a time, for a node never seems to fall back."""
        with self._reporting:
            self._log_news()
            self._diagnostics.publish(self.state, self.reason, self.figures)
            self._reported = self.next_sample
            info = self.info if self.ready or self.state in (RUNNING, DONE, FAILED) else None
            self._state_publisher.publish(
                state_message(info, self.get_name(), self.state, self._reported, self.reason)
            )

    def destroy_node(self) -> None:
        """End the heartbeat too."""
        self._ended.set()
        if self._heartbeat.is_alive():
            self._heartbeat.join()
        self._readers.clear()
        self.on_closed()  # hardware and bag are closed; what remains is to leave ROS
        super().destroy_node()

    def _log_news(self) -> None:
        """Log the state and its reason, where more than a number has changed.

        Reasons given while the node runs are logged at their origin.
        """
        said = f"{self.state}: {self.reason}" if self.reason else self.state
        said = self.state if self.state == RUNNING else said
        changed, self._logged = sub(r"\d+", "", said) != self._logged, sub(r"\d+", "", said)
        if changed and self.state == FAILED:
            self.get_logger().error(said)
        elif changed:
            self.get_logger().info(f"{said} (sample {self.next_sample})")

    def _beat(self) -> None:
        while not self._ended.wait(self.safety.heartbeat):
            self.report()

    def _hear(self, message: Message, _: int) -> None:
        if (m := message).node != self.get_name():
            now = time.monotonic()
            self.peers.hear(Report(m.node, m.scan_id, m.state, m.next_sample, m.reason, now))

    def crowded(self) -> str:
        """Return which topic has not the one publisher that it should have, if any."""
        for name in self.inputs:
            if (count := self.count_publishers(name)) != 1:
                nodes = sorted(node for node in self._gids(name).values() if node != _UNNAMED)
                named = f" ({', '.join(nodes)})" if nodes else ""
                return f"waits for one publisher of {name}, not {count}{named}"
        return ""

    def pin_publishers(self) -> None:
        """Take the publishers that there are now as those of the scan."""
        self._publishers_of = {topic: self._gids(topic) for topic in self.inputs}

    def _gids(self, topic: str) -> dict[bytes, str]:
        """Return the names of the nodes that publish a topic, by the identifiers of the writers.

        By DDS's name of the topic, since rclpy remaps a name of ROS once more.
        """
        found = self.get_publishers_info_by_topic(f"rt{topic}", no_mangle=True)
        return {bytes(each.endpoint_gid): each.node_name for each in found}

    def _watch_publishers(self, now: float) -> None:
        """Raise ScanError where a topic of the scan has got another publisher, once it is named."""
        for topic, pinned in self._publishers_of.items():
            if self.count_publishers(topic) > len(pinned):
                self._crowded_since = self._crowded_since or now
                others = sorted({*self._gids(topic).values()} - {*pinned.values(), _UNNAMED})
                if others or now - self._crowded_since > self.safety.naming:
                    named = f" ({', '.join(others)})" if others else ""
                    raise ScanError(f"{topic} has another publisher{named}: stop all but one")

    def _late(self, now: float) -> str | None:
        timeout = self.settings["startup_timeout_s"]
        if now - self._started < timeout:
            return None
        waiting = ", ".join(self.peers.lacking(READY, RUNNING, DONE))
        return f"no scan after {timeout:g} s: {self.reason or f'waits for {waiting}'}"


def _named(endpoints: Iterable[Publisher | Subscription]) -> str:
    """Return the topics of endpoints, but for those that rclpy makes by itself."""
    names = {each.topic_name for each in endpoints} - {"/rosout", "/parameter_events"}
    return ", ".join(sorted(names)) or "nothing"
