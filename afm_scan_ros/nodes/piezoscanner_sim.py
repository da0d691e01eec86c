"""Node: the simulated piezoscanner, drive voltage in, displacement out, measured and true."""

import time
from collections import deque
from collections.abc import Iterator

import numpy as np

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.align import end, part
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers.client import DriverProcess
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.nodes.block_consumer import BlockConsumer, min_subscriptions
from afm_scan_ros.nodes.block_guard import MAX_BLOCK
from afm_scan_ros.nodes.parameters import DRIVE_LIMITS, NodeParameter, drive_limits
from afm_scan_ros.nodes.peers import DONE, RUNNING
from afm_scan_ros.nodes.run import IDLE, run_node
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, TRUE, NodeTopic

LOOK = 0.02
"""Seconds between two looks at the nodes upstream."""
AHEAD = 0.05
"""Longest drive (s) given to the driver at once: it is output even if this process is gone."""
DRIVER = "afm_scan_ros.drivers.simulated:SimulatedScanner"


class PiezoscannerSim(BlockConsumer):
    """Passes the drive to the driver's process, and publishes its answers.

    It never waits for an answer, so that its state is published while a block is simulated.
    """

    NAME = "piezoscanner_sim"

    PARAMETERS = (
        NodeParameter(
            "plant_file", str(share_directory() / "config/plant.yaml"), "Simulated scanner"
        ),
        NodeParameter("seed", 1, "Seed of the sensor's noise", low=0),
        NodeParameter(
            "upstream_timeout_s",
            0.5,
            "Time without a sign of an upstream node, or of this node, until the drive ramps down",
            low=0.2,
        ),
        NodeParameter(
            "driver_timeout_s", 60.0, "Longest time that the driver may take for a block", low=0.1
        ),
        NodeParameter("output_log", "", "File for the outputs and their moments; empty for none"),
        *DRIVE_LIMITS,
        min_subscriptions(1),
        min_subscriptions(1, of="true_"),
    )

    def __init__(self) -> None:
        super().__init__()
        given, limits = self.settings, drive_limits(self.settings)
        scanner = {name: given[name] for name in ("plant_file", "seed", "output_log")}
        scanner |= {"voltage_limit": limits.voltage, "slew_limit": limits.slew}
        silence = given["upstream_timeout_s" if given["real_time"] else "liveness_timeout_s"]
        self._driver = DriverProcess(DRIVER, scanner, silence, given["driver_timeout_s"])
        self._queue: deque[tuple[Trace, bool]] = deque()
        self._moving: list[tuple[Trace, bool]] = []
        self._more_may_come = False
        self._next_look = 0.0
        self.read([DRIVE])
        self.write(ACHIEVED, given["min_subscriptions"])
        self.write(TRUE, given["min_true_subscriptions"])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Let the driver build the scanner."""
        self._driver.start(info.sample_period)
        while self._driver.waiting:
            yield "builds the scanner"
            self._driver.answer(IDLE)

    def step(self) -> bool:
        """Keep the driver running while no error is found."""
        self._watch_upstream()
        self._driver.show_life()
        self._publish_answer()
        self._move_on()
        return super().step() or bool(self._moving)

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - reads one topic
        """Queue a block for the driver."""
        self._queue.append((block, last))
        self._more_may_come = True

    def advance(self) -> None:
        """Leave progress to the driver: a block is finished when it has answered."""

    def settle(self, reason: str) -> str:
        """Ramp the drive down before anything is said."""
        return self._driver.ramp_down(reason)

    def destroy_node(self) -> None:
        """End the driver's process too."""
        self._driver.close()
        super().destroy_node()

    def _move_on(self) -> None:
        """Give the driver, if it is idle, the blocks received meanwhile as one block."""
        if self._driver.waiting or not self._queue:
            return
        self._moving = [self._queue.popleft()]
        count, period = self._moving[0][0].x.size, self.scan.sample_period
        most = min(MAX_BLOCK, AHEAD / period)
        while self._queue and (count := count + self._queue[0][0].x.size) <= most:
            self._moving.append(self._queue.popleft())
        x, y = (np.concatenate([b.axis(axis) for b, _ in self._moving]) for axis in AXES)
        self._driver.advance(Trace(self._moving[0][0].first_sample, period, x, y))

    def _publish_answer(self) -> None:
        """Publish the displacement in the blocks of the drive, while the scanner moves on."""
        if not self._moving:
            return
        wait, self._more_may_come = 0.0 if self._more_may_come else IDLE, False
        answer = self._driver.answer(wait)
        if answer is None:
            return
        moved, self._moving = self._moving, []
        self._move_on()
        for block, last in moved:
            start, stop = block.first_sample, end(block)
            self.send(ACHIEVED, part(answer.measured, start, stop), last=last)
            if answer.true is not None:
                self.send(TRUE, part(answer.true, start, stop), last=last)
            self.advance_to(stop)
            if last:
                self.go(DONE)

    def _watch_upstream(self) -> None:
        """Raise ScanError where the drive must be ramped down."""
        now = time.monotonic()
        if self.state != RUNNING or now < self._next_look:
            return
        self._next_look = now + LOOK
        if not self.settings["real_time"]:
            if failure := self.peers.failure():
                raise ScanError(failure)
            return  # a node that computes is heard late: ``watch`` judges silence
        nodes = self.scan.nodes
        upstream = nodes[: nodes.index(self.get_name())] if self.get_name() in nodes else nodes[:1]
        timeout = self.settings["upstream_timeout_s"]
        if trouble := self.peers.failure() or self.silence(upstream, now, timeout):
            raise ScanError(trouble)


def main() -> int:
    """Run the node."""
    return run_node(PiezoscannerSim)
