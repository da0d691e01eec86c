"""A link between two hosts that loses, delays and reorders what the nodes send."""

import os
import subprocess
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.hosts import (
    ADDRESSES,
    Carried,
    NetworkLink,
    host_environment,
    on_host,
    two_hosts,
)
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import FLOW, numbered, undisturbed
from afm_scan_ros.cli.processes import NodeCommand
from afm_scan_ros.report.table import Row

TRIALS = 10
LINK = NetworkLink(loss=0.05, delay=0.05, spread=0.02)
HERE, THERE = ADDRESSES
HOSTS = dict.fromkeys(NODES[:2], HERE) | dict.fromkeys(NODES[2:], THERE)
"""The inverse computes on one host; the scanner, its monitor and recorder are on the other."""
PATIENT: Mapping[str, object] = {"liveness_timeout_s": 3.0}
"""A packet lost twice makes a node seem silent for longer than the 0.8 s of a good link."""
TIMEOUTS = dict.fromkeys(NODES, PATIENT) | {
    "piezoscanner_sim": {**PATIENT, "upstream_timeout_s": 3.0}
}
PATIENCE = 180.0


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Scan over the link."""
    fault = "link: 5 % lost, 50 to 70 ms, reordered"
    if os.geteuid() != 0:
        yield row(fault, 0, [], "not tried: network namespaces need root")
        return
    broken, took, came, lost = [], [], 0, 0
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder))
        for number, where in numbered(announce, "scans over a bad link", trials, folder):
            began = time.monotonic()
            trouble, carried = scan_over(LINK, where, number, calm)
            broken += [trouble] if trouble else []
            came, lost = came + carried.came.value, lost + carried.lost.value
            took.append(time.monotonic() - began)
    figures = (
        f"{lost} of {came} packets lost; {calm.total_samples} samples in at most"
        f" {max(took):.0f} s, starting included"
    )
    yield row(fault, trials, broken, figures)


def scan_over(link: NetworkLink, folder: Path, seed: int, calm: Undisturbed) -> tuple[str, Carried]:
    """Make one scan over a link; return what of it is missing, if anything, and the traffic."""
    folder.mkdir()
    with two_hosts(link, seed) as carried:
        nodes = {name: _started(name, folder) for name in HOSTS}
        deadline = time.monotonic() + PATIENCE
        for process in nodes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    if any(process.returncode for process in nodes.values()):
        errors = [path.read_text("utf-8").strip() for path in sorted(folder.glob("*.txt"))]
        return "; ".join(filter(None, errors)) or "hung", carried
    return calm.missing(folder / "bag"), carried


def _started(name: str, folder: Path) -> "subprocess.Popen[bytes]":
    bag = {"bag": str(folder / "bag")} if name == "scan_recorder" else {}
    given = {**FLOW.get(name, {}), **TIMEOUTS[name], **bag}
    with (folder / f"{name}.txt").open("wb") as output:
        return subprocess.Popen(  # noqa: S603 - our own words
            on_host(HOSTS[name], NodeCommand(name, given).arguments()),
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            env=host_environment(HOSTS[name]),
        )
