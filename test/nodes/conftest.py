"""A domain of the tests' own, on this machine alone; a small scan; all needs ROS."""

import socket
from collections import deque
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from itertools import cycle
from pathlib import Path
from typing import NoReturn

import pytest

from afm_scan_ros.cli.processes import NodeCommand, NodeProcess

SPEC = """\
/**/trajectory_generator:
  ros__parameters:
    range_x_um: 10.0
    range_y_um: 10.0
    line_rate_hz: 20.0
    lines: 6
    samples_per_line: 1000
    preparation_cycles: 5
    block_size: 500
    window: 5000
"""
DOMAINS = range(215, 232)
"""Of ROS, beyond those that a command takes for itself; no system hands their ports out."""
CLAIM = 249
"""Port of a domain that no participant takes, for none is its hundredth."""
KEPT = 6
"""Domains that a process of tests keeps claimed: two of them leave a third of all to others."""
PATIENT = {"liveness_timeout_s": 5.0, "progress_timeout_s": 5.0}
DRIVING = {"upstream_timeout_s": 5.0}
"""Parameters of nodes, and of those that drive a scanner."""


def claimed() -> Iterator[int]:
    """Yield domains in turn that no other process of tests has claimed, by a port of each."""
    kept: deque[socket.socket] = deque()
    refused = 0
    for domain in cycle(DOMAINS):
        if refused == len(DOMAINS):
            pytest.fail("all domains of the tests are in use")
        while len(kept) >= KEPT:
            kept.popleft().close()
        claim = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            claim.bind(("127.0.0.1", 7400 + 250 * domain + CLAIM))
        except OSError:
            claim.close()
            refused += 1
            continue
        kept.append(claim)
        refused = 0
        yield domain


CLAIMED = claimed()


class WithoutRos(pytest.Module):
    """A file of tests that cannot be imported."""

    def collect(self) -> NoReturn:
        """Skip all of it."""
        pytest.skip("needs rclpy: make test-ros")


if find_spec("rclpy") is None:

    def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> WithoutRos:
        """Import no file of tests."""
        made: WithoutRos = WithoutRos.from_parent(parent, path=module_path)
        return made


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Share a domain with the nodes that the test starts, and with nobody else.

    One that was killed is counted in its domain until its lease ends, 20 s at most. So each test
    takes the next domain, and the last few are kept from the tests beside this one.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next(CLAIMED)))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    """Return the file of a scan of half a second, at 20 kHz."""
    path = tmp_path / "scan.yaml"
    path.write_text(SPEC, "utf-8")
    return path


@pytest.fixture
def start() -> Iterator[Callable[..., NodeProcess]]:
    """Return a function that starts a node by name; it ends with the test.

    Unless told otherwise it bears other work of the computer for seconds.
    """
    started: list[NodeProcess] = []

    def run(name: str, file: Path | None = None, **given: object) -> NodeProcess:
        patient = PATIENT | (DRIVING if name in ("piezoscanner_sim", "scanner_driver") else {})
        started.append(NodeProcess.start(NodeCommand(name, patient | given, file)))
        return started[-1]

    yield run
    for node in started:
        node.process.kill()
        node.process.communicate()
        node.output.close()
