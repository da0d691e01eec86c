"""A scan that was stopped on request has no failed node, and yet is incomplete."""

import pytest

from afm_scan_ros.cli import processes
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes.flow import STOPPED
from afm_scan_ros.nodes.together import Ended


def test_a_stopped_scan_is_incomplete_to_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    said = f"trajectory_generator: done: {STOPPED} at sample 5"
    ended = [Ended("trajectory_generator", 0, said), Ended("scan_recorder", 0, "")]
    monkeypatch.setattr(processes, "run_together", lambda *_: ended)
    monkeypatch.setattr(processes, "ALONE", "no DDS")
    with pytest.raises(ScanError, match=f"^{said}$"):
        processes.run_nodes([], lambda: None)
