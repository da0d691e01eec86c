"""Node: the simulated piezoscanner, drive voltage in, displacement out, measured and true."""

import time
from collections import deque
from collections.abc import Iterator

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.client import DriverProcess
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.nodes.block_consumer import BlockConsumer, min_subscriptions
from afm_scan_ros.nodes.parameters import DRIVE_LIMITS, NodeParameter, drive_limits
from afm_scan_ros.nodes.peers import DONE, RUNNING
from afm_scan_ros.nodes.run import IDLE, run_node
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, TRUE, NodeTopic

DRIVER = "afm_scan_ros.drivers.simulated:SimulatedScanner"


class PiezoscannerSim(BlockConsumer):
    """Passes the drive on to the driver's process, and what that answers to the others.

    It waits for no answer, so that the others hear of it however long a block takes to simulate.
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
        NodeParameter("output_log", "", "File for the outputs and their moments; empty for none"),
        *DRIVE_LIMITS,
        min_subscriptions(1),
        min_subscriptions(1, of="true_"),
    )

    def __init__(self) -> None:
        super().__init__()
        given, limits = self.settings, drive_limits(self.settings)
        scanner = {
            "plant_file": given["plant_file"],
            "seed": given["seed"],
            "voltage_limit": limits.voltage,
            "slew_limit": limits.slew,
            "output_log": given["output_log"],
        }
        self._driver = DriverProcess(DRIVER, scanner, given["upstream_timeout_s"])
        self._queue: deque[tuple[Trace, bool]] = deque()
        self._moving: tuple[Trace, bool] | None = None
        self._more_may_come = False
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
        """Keep the driver driving for as long as there is nothing against it."""
        if self.state == RUNNING and (trouble := self._trouble()):
            raise ScanError(trouble)
        self._driver.show_life()
        self._publish_answer()
        self._move_on()
        return super().step() or self._moving is not None

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - reads one topic
        """Queue a block for the driver."""
        self._queue.append((block, last))
        self._more_may_come = True

    def advance(self) -> None:
        """Leave progress to the driver: nothing is finished with before it has answered."""

    def settle(self, reason: str) -> str:
        """Ramp the drive down before anything is said."""
        return self._driver.ramp_down(reason)

    def destroy_node(self) -> None:
        """End the driver's process too."""
        self._driver.close()
        super().destroy_node()

    def _move_on(self) -> None:
        if self._moving is None and self._queue:
            self._moving = self._queue.popleft()
            self._driver.advance(self._moving[0])

    def _publish_answer(self) -> None:
        """Publish where the scanner moved to, while it moves on with the next block."""
        if self._moving is None:
            return
        wait, self._more_may_come = 0.0 if self._more_may_come else IDLE, False
        displacement = self._driver.answer(wait)
        if displacement is None:
            return
        block, last = self._moving
        self._moving = None
        self._move_on()
        self.send(ACHIEVED, displacement.measured, last=last)
        if displacement.true is not None:
            self.send(TRUE, displacement.true, last=last)
        self.advance_to(block.first_sample + block.x.size)
        if last:
            self.go(DONE)

    def _trouble(self) -> str | None:
        """Return why the drive must be ramped down.

        In simulation a node that computes is heard late: ``watch`` then judges silence.
        """
        if not self.settings["real_time"]:
            return self.peers.failure()
        nodes = self.scan.nodes
        upstream = nodes[: nodes.index(self.get_name())] if self.get_name() in nodes else nodes[:1]
        timeout = self.settings["upstream_timeout_s"]
        return self.peers.failure() or self.peers.silence(upstream, time.monotonic(), timeout)


def main() -> int:
    """Run the node."""
    return run_node(PiezoscannerSim)
