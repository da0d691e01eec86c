"""The time from a fault to outputs at rest, from what the process that owns them recorded.

A record at high drive is made in real time, by a source as it is and a scanner's node with a fault
in it.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rclpy
from attrs import define, field
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from afm_scan_bench.faults.injection.faulty_scanner import (
    FAULT_AT,
    HANGS,
    RECORDER,
    SCANNER,
    SILENT,
    SOURCE,
    Fault,
    note,
)
from afm_scan_bench.faults.injection.processes import INCOMPLETE
from afm_scan_bench.faults.injection.trial import MOMENT, PATIENCE, Trial
from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.nodes.peers import FAILED
from afm_scan_ros.nodes.topics import ACHIEVED, DRIVE

RECORD: Mapping[str, object] = {
    "scan_id": "this",
    "required_nodes": [SCANNER, RECORDER],
    "min_subscriptions": 2,
    "block_size": 500,
    "window": 5000,
}
RECORDED: Mapping[str, object] = {"topics": [DRIVE.name, ACHIEVED.name]}
READERS = 2
"""Readers of the drive: the scanner and the recorder."""
PERIOD = 5e-5
"""Sample period (s) of the record."""
RISE = 0.5
"""Seconds in which the drive rises, before it swings between 3.4 and 4 V at 2 Hz."""
LONGEST_RECORD = 10.0
"""Seconds in which a record that runs reaches the fault, on a busy machine."""
LONGEST = 200
"""Bytes of two rows of the record, and more."""
BLOCKING = """<?xml version="1.0"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <data_writer profile_name="writer" is_default_profile="true">
    <topic><resourceLimitsQos><max_samples>8</max_samples><max_instances>1</max_instances>
      <max_samples_per_instance>8</max_samples_per_instance></resourceLimitsQos></topic>
    <qos><reliability><kind>RELIABLE</kind>
      <max_blocking_time><sec>120</sec></max_blocking_time></reliability></qos>
  </data_writer>
</profiles>
"""
"""Settings of Fast DDS with which a stopped reader blocks the writer after eight messages."""


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
        last = self.last()
        return last.size > 0 and last[1] >= sample

    def is_at_rest(self) -> bool:
        """Return whether the record ends with outputs at 0 V, after the fault."""
        return self.has_reached(FAULT_AT + 1) and not np.any(self.last()[2:])

    def last(self) -> Array:
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
        given = {
            "output_log": log,
            "min_subscriptions": 1 + fault.viewer,
            "min_true_subscriptions": 0,
        }
        blocks = {}
        if fault.viewer:
            (profile := folder / "blocking.xml").write_text(BLOCKING, "utf-8")
            blocks = {
                "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
                "RMW_FASTRTPS_USE_QOS_FROM_XML": "1",
            }
        node = _started("faulty_node", fault, log, given, blocks)
        watch = f"from {__name__} import watch; watch()"
        viewer = subprocess.Popen([sys.executable, "-P", "-c", watch]) if fault.viewer else None  # noqa: S603
        return cls(fault, OutputLog(log), node, viewer)

    def inject(self, trial: Trial) -> None:
        """Do what is done from outside."""
        if self.viewer is not None:
            self.viewer.send_signal(signal.SIGSTOP)
        if self.fault.forged:
            note(self.log.path)
            _forge(self.log)
        if not self.fault.number:
            return
        note(self.log.path)
        if self.fault.to in trial.nodes:
            trial.nodes[self.fault.to].send(self.fault.number)
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


def high_drive_source(folder: Path) -> dict[str, object]:
    """Write the drive, y opposed to x, to a file; return the parameters of its source."""
    time = PERIOD * np.arange(round((LONGEST_RECORD + 1.0) / PERIOD))
    level = np.minimum(time / RISE, 1.0) * (3.7 - 0.3 * np.cos(4.0 * np.pi * time))
    folder.mkdir(parents=True, exist_ok=True)
    drive = np.column_stack([level, -level])
    np.savez(file := folder / "drive.npz", drive_v=drive, sample_period_s=PERIOD)
    return {**RECORD, "drive_file": str(file)}


def _started(
    run: str,
    fault: Fault,
    log: Path,
    parameters: Mapping[str, object],
    environment: Mapping[str, str],
) -> "subprocess.Popen[bytes]":
    """Start a node with a fault; what it writes lies beside the log."""
    code = f"import sys; from {Fault.__module__} import {run}; sys.exit({run}(*sys.argv[1:3]))"
    pairs = [f"{name}:={json.dumps(value, default=str)}" for name, value in parameters.items()]
    arguments = [word for pair in pairs for word in ("-p", pair)]
    with (log.parent / f"{run}.txt").open("wb") as output:
        return subprocess.Popen(  # noqa: S603 - our own interpreter and module
            [sys.executable, "-P", "-c", code, fault.name, str(log), "--ros-args", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
            env={**os.environ, **environment},
        )


def _forge(log: "OutputLog") -> None:
    """Publish drive of the scan, from where its outputs are."""
    node = Node("forger")
    publisher = node.create_publisher(DRIVE.kind, DRIVE.name, DRIVE.writer)
    deadline = time.monotonic() + PATIENCE
    while publisher.get_subscription_count() < READERS and time.monotonic() < deadline:
        time.sleep(MOMENT)
    info = ScanInfo("this", 10**18, "hysteresis", PERIOD, 10**6)
    first = int(log.last()[1])
    for start in range(first, first + 5000, 500):
        block = Trace(start, PERIOD, np.full(500, -4.9), np.full(500, -4.9))
        publisher.publish(encode_block(DRIVE.type_name, info, block, last=False))


def watch() -> None:
    """Read the displacement reliably, as somebody's viewer does."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("viewer")
    node.create_subscription(ACHIEVED.kind, ACHIEVED.name, lambda _: None, ACHIEVED.reader)
    rclpy.spin(node)


def endanger(folder: Path, fault: Fault) -> DriveOutcome:
    """Inject a fault into one scan, and see when the outputs were at rest."""
    source, done = high_drive_source(folder.with_name(f"{folder.name}_drive")), DriveOutcome()
    with Trial(folder, **{SOURCE: source, RECORDER: RECORDED}) as trial:
        neighbours = _start_neighbours(trial, folder, fault, source)
        scanner = FaultyProcesses.start(folder, fault)
        try:
            _follow(trial, scanner, done)
        finally:
            scanner.kill()
            for neighbour in neighbours:
                neighbour.kill()
                neighbour.wait()
        if not trial.until(scanner.has_ended, PATIENCE):
            done.broken.append("the driver's process outlived its node")
    return done


def _start_neighbours(
    trial: Trial, folder: Path, fault: Fault, source: Mapping[str, object]
) -> "list[subprocess.Popen[bytes]]":
    """Start source and recorder; return the one that has a fault of its own."""
    faulty = fault.to if fault.method and fault.to in (SOURCE, RECORDER) else ""
    trial.start(*(name for name in (SOURCE, RECORDER) if name != faulty))
    if not faulty:
        return []
    given = source if faulty == SOURCE else {**RECORDED, "bag": trial.bag}
    return [_started("faulty_neighbour", fault, folder / "outputs.txt", given, {})]


def _follow(trial: Trial, scanner: FaultyProcesses, done: DriveOutcome) -> None:
    if not trial.until(lambda: scanner.log.has_reached(0)):
        done.broken.append("the scan did not begin")
        return
    scanner.find_driver()
    if not trial.until(lambda: scanner.log.has_reached(FAULT_AT), LONGEST_RECORD):
        failed = {each.reason for each in trial.heard if each.state == FAILED}
        done.broken.append(f"the scan ended before the fault: {failed}")
        return
    scanner.inject(trial)
    if not trial.until(scanner.log.is_at_rest):
        done.broken.append("the outputs stayed up")
        return
    scanner.log.measure(done)
    _judge_words(trial, scanner, done)


def _judge_words(trial: Trial, scanner: FaultyProcesses, done: DriveOutcome) -> None:
    """See that every node that can has failed, and that somebody named the reason."""
    if scanner.fault.message not in (SILENT, HANGS):
        trial.until(lambda: scanner.node.poll() is not None)
        if scanner.node.returncode not in (1, INCOMPLETE):
            done.broken.append(f"the scanner's node ended with {scanner.node.returncode}")
    if scanner.fault.to != SOURCE:
        trial.until(lambda: trial.statuses()[SOURCE] is not None)
        if trial.statuses()[SOURCE] != INCOMPLETE:
            done.broken.append(f"the source ended with {trial.statuses()[SOURCE]}")
    failed = [each.reason for each in trial.heard if each.state == FAILED]
    done.named = any(scanner.fault.message in reason for reason in failed)
    if not done.named:
        done.broken.append(f"no node reported '{scanner.fault.message}', but {failed}")
