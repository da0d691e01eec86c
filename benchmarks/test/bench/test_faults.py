"""Faults injected into scans of real processes; ``afm-scan bench faults`` injects many more."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

pytest.importorskip("rclpy")

from afm_scan_bench.faults.injection import order
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.disk import fill
from afm_scan_bench.faults.injection.kill import RECORDER, SCANNER, kill
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.signal import interrupt
from afm_scan_bench.faults.injection.trial import undisturbed


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Undisturbed]:
    """Make the scan that nothing disturbs, in an environment where each finds its own domain."""
    with mock.patch.dict(os.environ):
        os.environ.pop("ROS_DOMAIN_ID", None)
        yield undisturbed(tmp_path_factory.mktemp("faults"))


@pytest.mark.parametrize("victim", [SCANNER, RECORDER])
def test_a_killed_node_costs_an_unfinished_chunk_at_most(
    calm: Undisturbed, tmp_path: Path, victim: str
) -> None:
    done = kill(tmp_path / "trial", NODES.index(victim), calm)
    assert done.victim == victim
    assert done.broken == []


def test_an_interrupted_scan_is_in_a_closed_bag(calm: Undisturbed, tmp_path: Path) -> None:
    generator = NODES.index("trajectory_generator")
    assert interrupt(tmp_path / "trial", generator, signal.SIGINT, calm).broken == []


def test_what_a_full_disk_took_can_be_read(calm: Undisturbed, tmp_path: Path) -> None:
    assert fill(tmp_path / "trial", 0, calm, mounted=False).broken == []


@pytest.mark.parametrize("disturb", order.DISTURBANCES.values())
def test_nothing_is_lost_or_doubled(
    calm: Undisturbed, tmp_path: Path, disturb: order.Disturbance
) -> None:
    assert order.scan(tmp_path / "trial", disturb, 1, calm) == ""
