"""The sources of a scan: they announce, start and pace it, and generate its blocks."""

import time
from abc import abstractmethod
from collections.abc import Mapping
from math import ceil
from pathlib import Path

from attrs import evolve
from rclpy.duration import Duration
from std_srvs.srv import Trigger

from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.drives.experiments import KINDS, resized
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.trajectory import desired, phases, stopped, stopped_total
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.drive_files import read_drive
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.nodes.declare import scan_spec
from afm_scan_ros.nodes.messages import Message, Outbox, info_message
from afm_scan_ros.nodes.parameters import (
    FLOW,
    MAX_MESSAGE_RATE,
    MODEL_FILE,
    STOPPED,
    USUAL_WINDOW,
    NodeParameter,
    block_size_at,
    identity,
    inverses_of,
    model_of,
    taking_part,
)
from afm_scan_ros.nodes.peers import DONE, READY, RUNNING
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.nodes.topics import DESIRED, DRIVE, SCAN_INFO, NodeTopic


class BlockSource(ScanNode):
    """The source of a scan; a subclass describes it and computes any block of it."""

    def __init__(self, topic: NodeTopic) -> None:
        super().__init__()
        self.reason = "waits for the other nodes"
        self.total = 0
        self._topic = topic
        self._start = 0.0
        self._block_size = 0
        self._hindered = time.monotonic()
        self._blocks = Outbox(self.create_publisher(topic.kind, topic.name, topic.writer))
        self._announced = False
        self._done_since = 0.0
        self._announcement = self.create_publisher(SCAN_INFO.kind, SCAN_INFO.name, SCAN_INFO.writer)
        for own in (SCAN_INFO, topic):
            self.listen_to(own)

    @abstractmethod
    def block(self, first: int, count: int) -> Trace:
        """Return ``count`` samples of the scan from sample ``first``."""

    def nodes(self) -> tuple[str, ...]:
        """Return all nodes of the scan in the order of the data flow."""
        return (self.get_name(), *self.settings["required_nodes"])

    def announce(self, info: ScanInfo) -> None:
        """State the scan, with its window; raises InputError where it cannot be paced so.

        It is published by the first step, when the others hear that this node is there.
        """
        given = self.settings
        self._block_size = given["block_size"] or block_size_at(info.sample_period)
        info = evolve(
            info,
            window=given["window"] or USUAL_WINDOW * self._block_size,
            sampling_instant=given["sampling_instant"],
            trigger_offset=given["trigger_offset_s"],
        )
        self._check_pace(info)
        self.total = info.total_samples
        self.begin(info)
        self.ready = True
        self.note_block(self._block_size)

    def step(self) -> bool:
        """Begin when all are ready, send what may be sent, end when all are done."""
        if not self._announced:
            self._announced = True
            self._announcement.publish(info_message(self.scan))
        if self.state == READY:
            self._begin_when_possible()
        elif self.next_sample < self.total:
            return self._send()
        elif self.state == DONE:
            self._leave_when_heard()
        elif self._blocks.flush(time.monotonic()) and not self.peers.lacking(DONE):
            self._done_since = time.monotonic()
            self.go(DONE, self.reason)
            self._leave_when_heard()
        return False

    def _leave_when_heard(self) -> None:
        """Leave once each viewer has the announcement, which goes with its publisher."""
        waited = time.monotonic() - self._done_since
        heard = self._announcement.wait_for_all_acked(Duration())
        if heard or waited > self.safety.discovery:
            self.leave()

    def figures(self) -> Mapping[str, object]:
        """Return also the lead over the slowest node, and the delay against the pace."""
        if self.info is None or self.state != RUNNING:
            return super().figures()
        lead = self.next_sample - self.peers.slowest()
        figures = {**super().figures(), "lead_samples": lead, "window": self.info.window}
        if not self.settings["time_scale"]:
            return figures
        return {**figures, "late_s": f"{max(0.0, time.monotonic() - self._due_at()):.3g}"}

    def watched(self) -> tuple[str, ...]:
        """Return all nodes once the scan runs; before, some may not exist yet."""
        return self.peers.names if self.state == RUNNING else ()

    def _begin_when_possible(self) -> None:
        """Begin once every node has reported after the last obstacle was removed."""
        now = time.monotonic()
        self.reason = self._hindrance(now)
        if self.reason:
            self._hindered = now
        elif unheard := self.peers.unheard_since(self._hindered):
            self.reason = f"waits for the state of {', '.join(unheard)}"
        else:
            self._start = now
            self.pin_publishers()
            self.peers.begin(now)
            self.go(RUNNING)

    def _hindrance(self, now: float) -> str:
        if waiting := self.peers.lacking(READY):
            return f"waits for {', '.join(waiting)}"
        if silent := self.peers.silence(self.peers.names, now, self.safety.doubt):
            return f"waits, for {silent}"
        if crowded := self.crowded():
            return crowded
        readers = self._blocks.publisher.get_subscription_count()
        if readers < (wanted := self.settings["min_subscriptions"]):
            return f"waits for {wanted} readers of {self._topic.name}"
        return ""

    def _send(self) -> bool:
        count = min(self._block_size, self.total - self.next_sample)
        end = self.next_sample + count
        now = time.monotonic()
        if self.peers.silence(self.peers.names, now, self.safety.doubt):
            return False  # a reader that is stopped would block us, and we would seem silent
        ahead = end - self.peers.slowest() > self.scan.window
        if ahead or now < self._due_at() or not self._blocks.flush(now):
            return False
        block = self.block(self.next_sample, count)
        cdr = encode_block(self._topic.type_name, self.scan, block, last=end == self.total)
        self._blocks.send(cdr, now)
        self._log_progress(self.next_sample, end)
        self.advance_to(end)
        return True

    def _due_at(self) -> float:
        """Return when (s, steady) the next block may be sent."""
        elapsed = self.next_sample * self.scan.sample_period * self.settings["time_scale"]
        return float(self._start + elapsed)

    def _log_progress(self, before: int, after: int) -> None:
        if (tenth := 10 * after // self.total) > 10 * before // self.total:
            self.get_logger().info(f"{10 * tenth} %: sample {after} of {self.total} is sent")

    def _check_pace(self, info: ScanInfo) -> None:
        size, window = self._block_size, info.window
        if window < 2 * size:
            raise InputError(f"window = {window} is less than two blocks: give at least {2 * size}")
        rate = self.settings["time_scale"] * info.sample_period * MAX_MESSAGE_RATE
        if rate > 0.0 and size * rate < 1.0:
            raise InputError(
                f"block_size = {size} makes more than {MAX_MESSAGE_RATE:g} messages a second:"
                f" give at least {ceil(1.0 / rate)}"
            )


class TrajectoryGenerator(BlockSource):
    """The source of a scan; ``stop`` lets it end early, smoothly at rest at zero."""

    NAME = "trajectory_generator"

    PARAMETERS = (
        *FLOW,
        taking_part("inversion_compensator", "piezoscanner_sim", "scan_recorder"),
        NodeParameter("inverses", list(INVERSES), "Effects that the compensator inverts; or none"),
        MODEL_FILE,
    )

    def __init__(self) -> None:
        super().__init__(DESIRED)
        self._spec = scan_spec(self)
        self._stopped_at: int | None = None
        desired(self._spec, phases(self._spec).lines.start, 1)  # a line is computed here, not later
        self.create_service(Trigger, "stop", self._stop)
        info = evolve(
            info_of_scan(self._spec, *identity(self.settings["scan_id"])),
            inverses=tuple(sorted(inverses_of(self.settings["inverses"], INVERSES))),
            model_hash=model_hash(model_of(self.settings)),
            nodes=self.nodes(),
        )
        self.announce(info)

    def block(self, first: int, count: int) -> Trace:
        """Return desired displacement, m."""
        if self._stopped_at is None:
            return desired(self._spec, first, count)
        return stopped(self._spec, self._stopped_at, first, count)

    def _stop(self, _: Message, response: Message) -> Message:
        response.success = self.state == RUNNING
        if self.state != RUNNING:
            response.message = f"nothing to stop: the generator is {self.state}"
            return response
        if self._stopped_at is None:
            self._stopped_at = self.next_sample
            self.total = stopped_total(self._spec, self.next_sample)
            self.reason = f"{STOPPED} at sample {self.next_sample}"
        response.message = self.reason
        return response


class ExcitationGenerator(BlockSource):
    """The source of a calibration record or experiment: the drive itself, without an inverse."""

    NAME = "excitation_generator"

    PARAMETERS = (
        *FLOW,
        taking_part("piezoscanner_sim", "scan_recorder"),
        NodeParameter("kind", "creep", "Kind of record", choices=tuple(KINDS)),
        NodeParameter("amplitude_v", 0.0, "Amplitude; 0 for that of the kind", low=0.0),
        NodeParameter("duration_s", 0.0, "Length; 0 for that of the kind", low=0.0),
        NodeParameter(
            "drive_file", "", "Drive in place of a kind: .npz with drive_v (n, 2), sample_period_s"
        ),
    )

    def __init__(self) -> None:
        super().__init__(DRIVE)
        sizes = (self.settings[name] or None for name in ("amplitude_v", "duration_s"))
        file = self.settings["drive_file"]
        plan = read_drive(Path(file)) if file else KINDS[self.settings["kind"]]()
        self._plan = resized(plan, *sizes)
        info = ScanInfo(
            *identity(self.settings["scan_id"]),
            self._plan.name,
            self._plan.sample_period,
            self._plan.total_samples,
            nodes=self.nodes(),
        )
        self.announce(info)

    def block(self, first: int, count: int) -> Trace:
        """Return drive voltage, V."""
        return excitation_block(self._plan, first, count)
