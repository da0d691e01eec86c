"""A node's process answers signals while it starts and while it ends."""

import signal
import subprocess
import sys

import pytest
from rclpy.node import Node

from afm_scan_ros.nodes.block_source import TrajectoryGenerator
from afm_scan_ros.nodes.topics import NODE_STATE, SCAN_INFO
from helpers.ros import PATIENCE, joined, until

SLOW_IMPORT = """
import sys, time
class Finder:
    def find_spec(self, name, *_):
        if name == "numpy":
            print("imports", flush=True)
            time.sleep(60.0)
sys.meta_path.insert(0, Finder())
from afm_scan_ros.nodes import start
start("scan_imager")
"""
SLOW_EXIT = """
import atexit, sys, time
from afm_scan_ros.nodes import start
def wait():
    print("ends", flush=True)
    sys.stdin.readline()
atexit.register(wait)
sys.exit(start("scan_imager"))
"""


def run(code: str, *words: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", code, *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_modules_are_imported_leaves_no_traceback(number: signal.Signals) -> None:
    with run(SLOW_IMPORT) as node:
        assert node.stdout is not None
        assert node.stdout.readline() == "imports\n"
        node.send_signal(number)
        _, said = node.communicate(timeout=PATIENCE)
        assert (node.returncode, said) == (0, "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_interpreter_ends_changes_no_status(number: signal.Signals) -> None:
    with run(SLOW_EXIT) as node:
        assert node.stdout is not None
        assert node.stderr is not None
        while "waits for scan_info" not in node.stderr.readline():
            assert node.poll() is None
        node.send_signal(number)
        assert node.stdout.readline() == "ends\n"
        node.send_signal(number)
        node.communicate("now\n", timeout=PATIENCE)
        assert node.returncode == 0


def test_what_keeps_a_node_from_being_made_is_logged_and_told_the_others() -> None:
    heard = []
    with joined():
        listener = Node("listener")
        topic = NODE_STATE
        listener.create_subscription(topic.kind, topic.name, heard.append, topic.reader)
        code = "from afm_scan_ros.nodes import start; raise SystemExit(start('scan_imager'))"
        with run(code, "--ros-args", "-p", "sample_file:=nowhere.npy") as node:
            until(lambda: heard and node.poll() is not None, listener)
            _, said = node.communicate()
        listener.destroy_node()
    logged, last = said.splitlines()[-2:]
    assert logged.startswith("[ERROR] [")
    assert "[scan_imager]: failed: nowhere.npy" in logged
    assert last.startswith("scan_imager: nowhere.npy")
    assert node.returncode == 2
    assert [(each.node, each.state) for each in heard] == [("scan_imager", "failed")]
    assert last == f"scan_imager: {heard[0].reason}"


def test_a_scan_is_announced_once_its_source_can_be_heard() -> None:
    """A reader that knows of the scan then misses its source by right."""
    with joined():
        listener, generator = Node("listener"), TrajectoryGenerator()
        heard = []
        for topic in (SCAN_INFO, NODE_STATE):
            listener.create_subscription(topic.kind, topic.name, heard.append, topic.reader)
        until(lambda: listener.count_publishers("/scan_info"), listener)
        generator.report()
        until(lambda: heard, listener)
        assert {type(each) for each in heard} == {NODE_STATE.kind}
        generator.step()
        until(lambda: type(heard[-1]) is SCAN_INFO.kind, listener)
        generator.destroy_node()
        listener.destroy_node()
