"""A node lives as long as the process that started it, and no longer."""

import signal
import subprocess
import sys
import time
from pathlib import Path

IDLE = """
import time
from afm_scan_ros.nodes import end_with_parent
end_with_parent()
print("begun", flush=True)
time.sleep(60.0)
"""
STARTS_A_NODE = """
import sys, time
from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
node = NodeProcess.start(NodeCommand("scan_recorder", {"bag": sys.argv[1]}))
print(node.process.pid, flush=True)
time.sleep(60.0)
"""


def test_the_pipe_s_end_is_the_process_s_end() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", IDLE], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stdout.readline() == b"begun\n"
        assert child.poll() is None
        child.stdin.close()
        assert child.wait(20.0) == -signal.SIGTERM


def running(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def test_a_node_ends_when_its_parent_is_killed(tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", STARTS_A_NODE, str(tmp_path / "bag")]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        node = int(parent.stdout.readline())
        assert running(node)
        parent.kill()
    deadline = time.monotonic() + 30.0
    while running(node):
        assert time.monotonic() < deadline, "the node outlived its parent"
        time.sleep(0.1)
