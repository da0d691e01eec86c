"""A DDS domain of the tests' own, on the loopback and without multicast; a small scan."""

import os
from pathlib import Path

import pytest

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


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Share a domain with the nodes that a test starts, and with nobody else."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")  # two that run at once never meet
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + 3 * (os.getpid() % 6) + int(worker[2:]) % 3))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    """Return the file of a scan of half a second, at 20 kHz."""
    path = tmp_path / "scan.yaml"
    path.write_text(SPEC, "utf-8")
    return path
