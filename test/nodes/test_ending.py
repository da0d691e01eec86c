"""A process that cannot leave ROS ends all the same, with its status."""

import subprocess
import sys

import pytest

LEAVES = """
import ctypes, os
from afm_scan_ros.nodes.ending import end_within
end_within(1, {status})
{leaves}
"""
HANGS = "ctypes.PyDLL(None).sleep(600)  # with the interpreter's lock"


@pytest.mark.parametrize("status", [0, 1, 3])
@pytest.mark.parametrize("leaves", [HANGS, "os.abort()", "ctypes.string_at(0)"])
def test_a_process_that_hangs_or_crashes_ends_with_its_status(status: int, leaves: str) -> None:
    code = LEAVES.format(status=status, leaves=leaves)
    done = subprocess.run([sys.executable, "-c", code], timeout=60, check=False)
    assert done.returncode == status


def test_a_process_that_ends_by_itself_ends_at_once() -> None:
    code = "from afm_scan_ros.nodes.ending import end_within; end_within(600, 1)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60, check=False).returncode == 0
