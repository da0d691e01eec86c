"""Node: the simulated piezoscanner, drive voltage in, displacement out, measured and true."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from attrs import evolve

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.share import share_directory
from afm_scan_ros.nodes.block_consumer import BlockConsumer, min_subscriptions
from afm_scan_ros.nodes.guarded_scanner import GuardedScanner
from afm_scan_ros.nodes.parameters import DRIVE_LIMITS, NodeParameter, drive_limits
from afm_scan_ros.nodes.peers import DONE, RUNNING
from afm_scan_ros.nodes.run import run_node
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE, TRUE, NodeTopic
from afm_scan_ros.simulation.scanner import Piezoscanner


class PiezoscannerSim(BlockConsumer):
    """Owns the converter, so it is the one that ramps the drive down when something fails."""

    NAME = "piezoscanner_sim"

    PARAMETERS = (
        NodeParameter(
            "plant_file", str(share_directory() / "config/plant.yaml"), "What it simulates"
        ),
        NodeParameter("seed", 1, "Seed of the sensor's noise", low=0),
        NodeParameter(
            "upstream_timeout_s",
            0.5,
            "Silence of a node upstream after which the drive is ramped down",
            low=0.2,
        ),
        *DRIVE_LIMITS,
        min_subscriptions(1),
        min_subscriptions(1, of="true_"),
    )

    def __init__(self) -> None:
        super().__init__()
        plant = load_plant(Path(self.settings["plant_file"]))
        amplifier = plant.amplifier.within(drive_limits(self.settings))
        self._plant = evolve(plant, amplifier=amplifier)
        self._scanner = GuardedScanner(self._trouble)
        self.read([DRIVE])
        self.write(ACHIEVED, self.settings["min_subscriptions"])
        self.write(TRUE, self.settings["min_true_subscriptions"])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Build the scanner; compile its code now, not while a scan waits for it."""
        yield "builds the scanner"
        plant, period, seed = self._plant, info.sample_period, self.settings["seed"]
        Piezoscanner(plant, period, seed).advance(Trace(0, period, np.zeros(2), np.zeros(2)))
        self._scanner.begin(Piezoscanner(plant, period, seed))

    def step(self) -> bool:
        """Tell the others what the watchdog did."""
        if self._scanner.outcome is not None:
            raise ScanError(self._scanner.outcome)
        return super().step()

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - reads one topic
        """Move as driven, and publish where to."""
        measured, true = self._scanner.advance(block)
        self.send(ACHIEVED, measured, last=last)
        self.send(TRUE, true, last=last)

    def fail(self, error: InputError | ScanError) -> None:
        """Ramp the drive down before anything is said."""
        if self.state in (RUNNING, DONE):
            error = ScanError(self._scanner.ramp_down(str(error)))
        super().fail(error)

    def destroy_node(self) -> None:
        """End the watchdog too."""
        self._scanner.close()
        super().destroy_node()

    def _trouble(self) -> str | None:
        """Return why the drive must be ramped down; asked by the watchdog's thread.

        In simulation a long callback keeps this node from hearing the others: whether they are
        silent is then for ``watch`` to say, which knows when the node listened.
        """
        if self.state != RUNNING:
            return None
        if not self.settings["real_time"]:
            return self.peers.failure()
        nodes = self.scan.nodes
        upstream = nodes[: nodes.index(self.get_name())] if self.get_name() in nodes else nodes[:1]
        timeout = self.settings["upstream_timeout_s"]
        return self.peers.failure() or self.peers.silence(upstream, time.monotonic(), timeout)


def main() -> int:
    """Run the node."""
    return run_node(PiezoscannerSim)
