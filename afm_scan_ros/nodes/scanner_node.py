"""The nodes that move a scanner, a simulated one or any: drive voltage in, displacement out."""

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import refuse_step
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import MAX_BLOCK, cut_as, end
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers import DriverChoice, load_settings, settings_file
from afm_scan_ros.drivers.client import DriverProcess
from afm_scan_ros.drivers.link import DriverTimeouts
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.block_consumer import min_subscriptions
from afm_scan_ros.nodes.managed_consumer import AUTOSTART, ManagedConsumer
from afm_scan_ros.nodes.parameters import SIMULATION, NodeParameter, simulated_scanner
from afm_scan_ros.nodes.peers import DONE, RUNNING
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, TRUE, NodeTopic

TIMEOUTS = (
    NodeParameter(
        "upstream_timeout_s",
        0.3,
        "Time without a sign of a node, or of this one, until the drive ramps down",
        low=0.2,
    ),
    NodeParameter(
        "driver_timeout_s",
        60.0,
        "Longest time that the driver may take to open or to start, and where real_time is false"
        " for a block",
        low=0.1,
    ),
    NodeParameter(
        "step_limit_v",
        0.0,
        "Largest change of the drive between samples that the scan needs; 0 for the slew limit's",
        low=0.0,
    ),
)


class ScannerNode(ManagedConsumer):
    """Passes the drive to the driver's process, and publishes its answers.

    It never waits for an answer, so that its state is published while a block is output. A
    subclass says which driver it is.
    """

    def __init__(self) -> None:
        super().__init__()
        self._choice = self.choice()
        self._driver: DriverProcess
        self._is_open = False
        self._queue: deque[tuple[Trace, bool]] = deque()
        self._moving: list[tuple[Trace, bool]] = []
        self._more_may_come = False
        self._before = dict.fromkeys(AXES, 0.0)
        self._asked = self._driving = 0.0
        self.read([DRIVE])
        self.autostart()

    @abstractmethod
    def choice(self) -> DriverChoice:
        """Return the driver and its settings; raises InputError where these are wrong."""

    def open(self) -> None:
        """Start the driver's process; raises InputError where the driver refuses its settings."""
        given = self.settings
        opening = given["driver_timeout_s"]
        upstream, liveness = given["upstream_timeout_s"], given["liveness_timeout_s"]
        # The nodes usually speak first, since they know of whom the drive is missing.
        starved = upstream * max(1.0, given["time_scale"]) + self.safety.heartbeat
        own = {"rest": self.safety.rest, "sign_of_life": self.safety.sign_of_life}
        real, simulated = (
            DriverTimeouts(upstream, starved, opening, upstream, real_time=True, **own),
            DriverTimeouts(liveness, opening, opening, opening, real_time=False, **own),
        )
        waits = real if given["real_time"] else simulated
        self._driver = DriverProcess(self._choice, waits).opened()
        self._is_open = True
        if self._driver.knows_true:  # before the other, whose readers then know of this one
            self.write(TRUE, given["min_true_subscriptions"])
        self.write(ACHIEVED, given["min_subscriptions"])

    def close(self) -> None:
        """End the driver's process, which ramps down; a node whose drive may be up has failed."""
        if not self._is_open:
            return
        self._is_open = False
        trouble = self._driver.close()
        if trouble and not self.status:
            self.status, self.reason = 3, trouble
            self.get_logger().error(trouble)

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Let the driver start; raises InputError where the scan does not fit its settings."""
        self._choice.refuse_other_instant(info.sampling_instant, info.trigger_offset)
        self._driver.start(info.sample_period)
        while self._driver.waiting:
            yield "waits for the driver to start"
            self._driver.answer(self.safety.idle)
        self.get_logger().info(f"driver: {self._driver.priority}")
        if 2 * (late := self._driver.latency_samples) > info.window:
            raise InputError(
                f"{self._choice.where}: latency_samples = {late}, with the driver's buffer, is over"
                f" half the scan's window of {info.window}: give the source a window of at least"
                f" {2 * late}"
            )

    def step(self) -> bool:
        """Keep the driver running while no error is found."""
        try:
            self._serve_driver()
        except ScanError as error:  # the driver may be the first to miss what another node owes
            raise ScanError(f"{error}{self._missing()}") from error
        return super().step() or bool(self._moving)

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - reads one topic
        """Queue a block for the driver; refuse a step that the scan cannot need."""
        if largest := self.settings["step_limit_v"]:
            refuse_step(block, self._before, largest)
        self._before = {axis: float(block.axis(axis)[-1]) for axis in AXES}
        self._queue.append((block, last))
        self._more_may_come = True

    def advance(self) -> None:
        """Leave progress to the driver: a block is finished when it has answered."""

    def figures(self) -> Mapping[str, object]:
        """Return also the driver and the drive that waits for it."""
        waiting = sum(block.x.size for block, _ in [*self._queue])
        return {
            **super().figures(),
            "driver": self._choice.driver,
            "buffer_samples": waiting,
        }

    def patience(self) -> float:
        """Return how long (s) another node may be silent while the drive is up."""
        name = "upstream_timeout_s" if self.settings["real_time"] else "liveness_timeout_s"
        return float(self.settings[name])

    def working_time(self) -> float:
        """Return how long the driver has worked (s)."""
        return self._driving

    def settle(self, reason: str) -> str:
        """Ramp the drive down before anything is said, even where the driver has by itself."""
        outcome = self._driver.ramp_down(reason) if self._is_open else reason
        if reason.startswith(outcome):
            return reason
        return outcome if outcome.startswith(reason) else f"{outcome}; {reason}"

    def _serve_driver(self) -> None:
        """Show the driver that the node lives, and exchange blocks with it."""
        if self._is_open:
            self._driver.show_life()
        if self.is_active:
            self._publish_answer()
            self._move_on()

    def _missing(self) -> str:
        """Name another node that keeps samples waiting, where there is one.

        Of all that was heard, also before this node paused: nothing is decided by it any more.
        """
        if self.state != RUNNING:
            return ""
        self.peers.listen_anew(0.0)
        trouble = self.standstill(0.5 * self.longest_standstill())
        return f"; {trouble}" if trouble and not trouble.startswith(self.get_name()) else ""

    def _move_on(self) -> None:
        """Give the driver, if it is idle, the blocks received meanwhile as one block."""
        if self._driver.waiting or not self._queue:
            return
        self._moving = [self._queue.popleft()]
        count, period = self._moving[0][0].x.size, self.scan.sample_period
        most = min(MAX_BLOCK, self.safety.ahead / period)
        while self._queue and (count := count + self._queue[0][0].x.size) <= most:
            self._moving.append(self._queue.popleft())
        x, y = (np.concatenate([b.axis(axis) for b, _ in self._moving]) for axis in AXES)
        drive = Trace(self._moving[0][0].first_sample, period, x, y)
        self._driver.advance(drive, last=self._moving[-1][1])
        self._asked = time.monotonic()

    def _publish_answer(self) -> None:
        """Publish the displacement in blocks as of the drive, while the scanner moves on."""
        if not self._moving:
            return
        wait, self._more_may_come = 0.0 if self._more_may_come else self.safety.idle, False
        answer = self._driver.answer(wait)
        if answer is None:
            if (late := time.monotonic() - self._asked) > self._longest_pause():
                late_by = f"the driver has not answered for {late:.2g} s"
                self.reason = f"{late_by}, and the drive may not be at rest"
            return
        self.reason = ""
        moved, self._moving = self._moving, []
        self._driving += time.monotonic() - self._asked
        self._move_on()
        last = moved[-1][1]
        for topic, displacement in ((ACHIEVED, answer.measured), (TRUE, answer.true)):
            if displacement is not None:
                for part in cut_as((block for block, _ in moved), displacement):
                    self.send(topic, part, last=last and end(part) == end(displacement))
        self.advance_to(end(moved[-1][0]))
        if last:
            self.go(DONE)


class PiezoscannerSim(ScannerNode):
    """The scanner of a plant file, in simulation."""

    NAME = "piezoscanner_sim"
    PARAMETERS = (
        *SIMULATION,
        AUTOSTART,
        *TIMEOUTS,
        min_subscriptions(1),
        min_subscriptions(1, of="true_"),
    )

    def choice(self) -> DriverChoice:
        """Return the simulated scanner; refuses a wrong plant file."""
        return simulated_scanner(self.settings, self.NAME)


class ScannerDriver(ScannerNode):
    """The scanner of a driver and its settings file."""

    NAME = "scanner_driver"

    PARAMETERS = (
        NodeParameter("driver", "", "module:Class, or a short name as simulated"),
        NodeParameter("settings_file", "", "Settings of the scanner and of its driver, in YAML"),
        AUTOSTART,
        *TIMEOUTS,
        min_subscriptions(1),
        min_subscriptions(0, of="true_"),
    )

    def choice(self) -> DriverChoice:
        """Return the driver that the parameters name; raises InputError where one is missing."""
        if not (driver := self.settings["driver"]):
            raise InputError("parameter driver: give it, as -p driver:=mylab:Stage")
        with naming("parameter settings_file"):
            file = settings_file(driver, self.settings["settings_file"])
            return load_settings(driver, file)
