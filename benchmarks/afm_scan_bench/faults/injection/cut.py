"""The network between the computers of source and scanner, cut within a scan."""

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from afm_scan_bench.faults.injection.drive import DriveOutcome, OutputLog, high_drive_source
from afm_scan_bench.faults.injection.faulty_scanner import FAULT_AT, SCANNER, SOURCE, note
from afm_scan_bench.faults.injection.hosts import (
    ADDRESSES,
    Carried,
    NetworkLink,
    host_environment,
    on_host,
    two_hosts,
)
from afm_scan_bench.faults.injection.trial import MOMENT, PATIENCE
from afm_scan_ros.cli.processes import NodeCommand

NAME = "network between source and scanner cut"
GOOD = NetworkLink(loss=0.0, delay=0.0, spread=0.0)
HERE, THERE = ADDRESSES
WORDS = {SOURCE: f"{SCANNER} has been silent", SCANNER: f"{SOURCE} has been silent"}
"""What each node is to report."""


def endanger(folder: Path) -> DriveOutcome:
    """Cut the network within one scan, and see when the outputs were at rest; needs root."""
    source = high_drive_source(folder)
    done, log = DriveOutcome(), OutputLog(folder / "outputs.txt")
    own = {"output_log": str(log.path), "min_subscriptions": 0, "min_true_subscriptions": 0}
    commands = {
        HERE: NodeCommand(SOURCE, source | {"required_nodes": [SCANNER], "min_subscriptions": 1}),
        THERE: NodeCommand(SCANNER, own),
    }
    with two_hosts(GOOD, 0) as carried:
        nodes = [_started(host, command, folder) for host, command in commands.items()]
        try:
            _follow(carried, log, done)
            for node in nodes:
                node.wait(PATIENCE)
        finally:
            for node in nodes:
                node.kill()
                node.wait()
    said = {name: (folder / f"{name}.txt").read_text("utf-8") for name in WORDS}
    done.named = all(words in said[name] for name, words in WORDS.items())
    if not done.named:
        done.broken.append(f"not named: {said}")
    return done


def _started(host: str, command: NodeCommand, folder: Path) -> "subprocess.Popen[bytes]":
    with (folder / f"{command.name}.txt").open("wb") as output:
        return subprocess.Popen(  # noqa: S603 - our own words
            on_host(host, command.arguments()),
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            env=host_environment(host),
        )


def _follow(carried: Carried, log: OutputLog, done: DriveOutcome) -> None:
    if not _until(lambda: log.has_reached(FAULT_AT)):
        done.broken.append("the scan did not begin")
        return
    note(log.path)
    carried.cut()
    if not _until(log.is_at_rest):
        done.broken.append("the outputs stayed up")
        return
    log.measure(done)


def _until(holds: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + PATIENCE
    while not holds() and time.monotonic() < deadline:
        time.sleep(MOMENT)
    return holds()
