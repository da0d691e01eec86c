"""The time from a fault to outputs at rest, from what the process that owns them recorded.

A calibration record of hysteresis is made in real time, by a source as it is and a scanner's node
with a fault in it.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from attrs import define, field

from afm_scan_bench.faults.injection.faulty_scanner import (
    FAULT_AT,
    SCANNER,
    SILENT,
    SOURCE,
    Fault,
    note,
)
from afm_scan_bench.faults.injection.processes import INCOMPLETE
from afm_scan_bench.faults.injection.trial import PATIENCE, Trial
from afm_scan_ros.core.types import Array
from afm_scan_ros.nodes.topics import ACHIEVED, FAILED
from afm_scan_ros.ros import Node, SignalHandlerOptions, SingleThreadedExecutor, init
from afm_scan_ros.ros.cyclone import HOLDS_LOCK

RECORD: Mapping[str, object] = {
    "kind": "hysteresis",
    "required_nodes": [SCANNER],
    "min_subscriptions": 1,
    "block_size": 500,
    "window": 5000,
}
LONGEST = 200
"""Bytes of two rows of the record, and more."""
SMALL_CACHE = (
    "<CycloneDDS><Domain><Internal><Watermarks><WhcHigh>64kB</WhcHigh><WhcHighInit>64kB"
    "</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks></Internal></Domain></CycloneDDS>"
)
"""Settings with which a stopped reader blocks the writer after four blocks."""


@define
class DriveOutcome:
    """What became of one scan; the time (s) is from the fault, the drive (V) that of the fault.

    ``named`` is whether a node reported the reason; ``broken`` says what else was not as promised.
    """

    seconds: float = float("nan")
    drive: float = float("nan")
    named: bool = False
    broken: list[str] = field(factory=list)


@define
class OutputLog:
    """What the driver's process recorded of its outputs, and when the fault was."""

    path: Path

    def outputs(self) -> Array:
        """Return the record: moment (s), next sample, x and y (V), a row for each block."""
        return np.loadtxt(self.path, ndmin=2)

    def has_reached(self, sample: int) -> bool:
        """Return whether the drive before a sample has been output."""
        last = self._last()
        return last.size > 0 and last[1] >= sample

    def is_at_rest(self) -> bool:
        """Return whether the record ends with outputs at 0 V, after the fault."""
        return self.has_reached(FAULT_AT + 1) and not np.any(self._last()[2:])

    def _last(self) -> Array:
        """Return the last row that is whole, read often: empty before there is one."""
        if not self.path.exists():
            return np.empty(0)
        with self.path.open("rb") as file:
            file.seek(max(0, self.path.stat().st_size - LONGEST))
            lines = file.read().split(b"\n")
        return np.array([float(number) for number in lines[-2].split()] if lines[1:] else [])

    def measure(self, done: DriveOutcome) -> None:
        """Fill in time and drive of an outcome: from the fault, or from the last block."""
        record = self.outputs()
        begun = Path(f"{self.path}.fault")
        moment = float(begun.read_text("utf-8")) if begun.exists() else record[-2, 0]
        done.seconds = record[-1, 0] - moment
        done.drive = float(np.max(np.abs(record[-2, 2:])))


@define(eq=False)
class FaultyProcesses:
    """The faulty node, its driver's process, and a viewer that may block it."""

    fault: Fault
    log: OutputLog
    node: "subprocess.Popen[bytes]"
    viewer: "subprocess.Popen[bytes] | None" = None
    driver: int = 0

    @classmethod
    def start(cls, folder: Path, fault: Fault) -> "FaultyProcesses":
        """Start them; what the node writes lies beside the log."""
        log = folder / "outputs.txt"
        run = (
            f"import sys; from {Fault.__module__} import faulty_node;"
            " sys.exit(faulty_node(*sys.argv[1:3]))"
        )
        given = {
            "output_log": log,
            "min_subscriptions": int(fault.viewer),
            "min_true_subscriptions": 0,
        }
        arguments = [word for pair in given.items() for word in ("-p", f"{pair[0]}:={pair[1]}")]
        blocks = {"CYCLONEDDS_URI": SMALL_CACHE, HOLDS_LOCK: "1"} if fault.viewer else {}
        with (folder / "node.txt").open("wb") as output:
            node = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-c", run, fault.name, str(log), "--ros-args", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                env={**os.environ, **blocks},
            )
        watch = f"from {__name__} import watch; watch()"
        viewer = subprocess.Popen([sys.executable, "-c", watch]) if fault.viewer else None  # noqa: S603
        return cls(fault, OutputLog(log), node, viewer)

    def inject(self, trial: Trial) -> None:
        """Do what is done from outside."""
        if self.viewer is not None:
            self.viewer.send_signal(signal.SIGSTOP)
        if not self.fault.number:
            return
        note(self.log.path)
        if self.fault.to == "source":
            trial.nodes[SOURCE].send(self.fault.number)
            return
        send = os.killpg if self.fault.to == "group" else os.kill
        send(self.driver if self.fault.to == "driver" else self.node.pid, self.fault.number)

    def find_driver(self) -> None:
        """Learn the number of the driver's process."""
        children = Path(f"/proc/{self.node.pid}/task/{self.node.pid}/children")
        self.driver = int(children.read_text("utf-8").split()[0])

    def has_ended(self) -> bool:
        """Return whether the driver's process is gone."""
        return not Path(f"/proc/{self.driver}").exists()

    def kill(self) -> None:
        """Kill the node, and what reads it."""
        for process in (self.node, self.viewer):
            if process is not None:
                process.kill()
                process.wait()


def watch() -> None:
    """Read the displacement reliably, as somebody's viewer does."""
    init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("viewer")
    node.create_subscription(ACHIEVED.kind, ACHIEVED.name, lambda _: None, ACHIEVED.reader)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while True:
        executor.spin_once(timeout_sec=1.0)


def endanger(folder: Path, fault: Fault) -> DriveOutcome:
    """Inject a fault into one scan, and see when the outputs were at rest."""
    folder.parent.mkdir(exist_ok=True)
    done = DriveOutcome()
    with Trial(folder, **{SOURCE: RECORD}) as trial:
        trial.start(SOURCE)
        scanner = FaultyProcesses.start(folder, fault)
        try:
            _follow(trial, scanner, done)
        finally:
            scanner.kill()
        if not trial.until(scanner.has_ended, PATIENCE):
            done.broken.append("the driver's process outlived its node")
    return done


def _follow(trial: Trial, scanner: FaultyProcesses, done: DriveOutcome) -> None:
    if not trial.until(lambda: scanner.log.has_reached(0)):
        done.broken.append("the scan did not begin")
        return
    scanner.find_driver()
    trial.until(lambda: scanner.log.has_reached(FAULT_AT))
    scanner.inject(trial)
    if not trial.until(scanner.log.is_at_rest):
        done.broken.append("the outputs stayed up")
        return
    scanner.log.measure(done)
    _judge_words(trial, scanner, done)


def _judge_words(trial: Trial, scanner: FaultyProcesses, done: DriveOutcome) -> None:
    """See that every node that can has failed, and that somebody named the reason."""
    if scanner.fault.message != SILENT:
        trial.until(lambda: scanner.node.poll() is not None)
        if scanner.node.returncode not in (1, INCOMPLETE):
            done.broken.append(f"the scanner's node ended with {scanner.node.returncode}")
    if scanner.fault.to != "source":
        trial.until_ended()
        if trial.statuses()[SOURCE] != INCOMPLETE:
            done.broken.append(f"the source ended with {trial.statuses()[SOURCE]}")
    failed = [each.reason for each in trial.heard if each.state == FAILED]
    done.named = any(scanner.fault.message in reason for reason in failed)
    if not done.named:
        done.broken.append(f"no node reported '{scanner.fault.message}', but {failed}")
