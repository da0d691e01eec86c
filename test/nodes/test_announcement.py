"""The announcement of a scan reaches its viewers before its publisher leaves."""

import time

import pytest
from rclpy.publisher import Publisher

from afm_scan_ros.nodes.block_source import TrajectoryGenerator
from afm_scan_ros.nodes.peers import DONE
from helpers.ros import PATIENCE, joined


@pytest.mark.parametrize("late", [0.0, 100.0])
def test_a_source_stays_until_viewers_have_its_announcement(
    monkeypatch: pytest.MonkeyPatch, late: float
) -> None:
    """The announcement goes with its publisher; one that is never acknowledged is left in time."""
    acknowledged: list[bool] = []
    monkeypatch.setattr(Publisher, "wait_for_all_acked", lambda *_: bool(acknowledged))
    with joined(min_subscriptions=0, time_scale=0.0, lines=2, samples_per_line=100):
        source = TrajectoryGenerator()
        source.peers.names = ()
        deadline = time.monotonic() + PATIENCE
        while source.state != DONE and time.monotonic() < deadline:
            source.step()
        for _ in range(3):
            source.step()
        assert (source.state, source.leaving) == (DONE, False)
        if late:
            now = time.monotonic()
            monkeypatch.setattr(time, "monotonic", lambda: now + late)
        else:
            acknowledged.append(True)
        source.step()
        assert source.leaving
        source.destroy_node()
