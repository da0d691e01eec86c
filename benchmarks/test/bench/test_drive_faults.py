"""Whatever becomes of the ROS side, or of the driver's own code, the outputs come to rest."""

import os
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from afm_scan_bench.faults.injection import cut
from afm_scan_bench.faults.injection.drive import DriveOutcome, endanger
from afm_scan_bench.faults.injection.faulty_scanner import FAULTS, HANG, Fault

LIMIT = 20.0
"""Seconds on a machine that has other work; ``bench drive`` measures the time."""


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_outputs_come_to_rest(tmp_path: Path, fault: Fault) -> None:
    expect_rest(endanger(tmp_path / "scans" / "0", fault))


def test_the_outputs_come_to_rest_without_a_network(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("network namespaces need root")
    expect_rest(cut.endanger(tmp_path / "scans" / "0"))


def expect_rest(done: DriveOutcome) -> None:
    assert done.broken == []
    assert done.named
    assert done.drive > 1.0  # so that there was something to ramp down
    assert done.seconds < LIMIT < HANG
