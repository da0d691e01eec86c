"""A scan that was stopped on request has no failed node, and yet is incomplete."""

import subprocess
import sys
import tempfile

import pytest

from afm_scan_ros.cli.processes import Ended, NodeProcess, raise_failure
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes.parameters import STOPPED


def test_a_stopped_scan_is_incomplete_to_the_command() -> None:
    said = f"trajectory_generator: done: {STOPPED} at sample 5"
    ended = [Ended("trajectory_generator", 0, said), Ended("scan_recorder", 0, "")]
    with pytest.raises(ScanError, match=f"^{said}$"):
        raise_failure(ended, [each.name for each in ended])


def test_what_a_node_warned_of_is_read_from_its_log_too() -> None:
    lines = ["[INFO] [1.5] [residual_monitor]: running", "[WARN] [2.5] [residual_monitor]: x: off"]
    code = f"print({chr(10).join(lines)!r})"
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
        process = subprocess.Popen([sys.executable, "-c", code], stdout=output, text=True)
        process.wait()
        assert NodeProcess("residual_monitor", process, output).ended().warnings == ("x: off",)
