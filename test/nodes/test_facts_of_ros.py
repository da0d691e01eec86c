"""What the package relies on in ROS: parameters, names, and domains kept apart."""

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import rclpy
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from afm_scan_ros.files import yaml
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.topics import DESIRED
from helpers.ros import joined, publisher, until

DOMAIN = 90
PORTS = """\
import json, os, socket, rclpy
rclpy.init(args=[])
node = rclpy.create_node("tested")
found = set()
for descriptor in map(int, os.listdir("/proc/self/fd")):
    try:
        opened = socket.socket(fileno=os.dup(descriptor))
    except OSError:
        continue
    if opened.family == socket.AF_INET:
        found.add(opened.getsockname()[1])
print(json.dumps(sorted(found)))
"""
TEXTS = st.one_of(
    st.sampled_from(["on", "No", "y", "0x1F", "017", "08", "1e-6", "-.5", ".inf", "1_0", "a"]),
    st.from_regex(r"[-+]?[0-9]{1,20}", fullmatch=True),
    st.from_regex(r"[-+]?[0-9]{0,3}\.[0-9]{1,3}([eE][-+]?[0-9]{1,2})?", fullmatch=True),
    st.from_regex(r"[a-zA-Z_][a-zA-Z0-9_]{0,8}", fullmatch=True),
)


@settings(max_examples=20)
@given(st.lists(TEXTS, min_size=20, max_size=50))
def test_a_file_means_to_us_what_it_means_to_ros(texts: list[str]) -> None:
    lines = "".join(f"    p{index}: {text}\n" for index, text in enumerate(texts))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "tested.yaml")
        file.write_text(f"/**:\n  ros__parameters:\n{lines}", "utf-8")
        ours = yaml.load(file)["/**"]["ros__parameters"]
        rclpy.init(
            args=["test", "--ros-args", "--params-file", str(file)],
            signal_handler_options=SignalHandlerOptions.NO,
        )
        node = Node("tested", automatically_declare_parameters_from_overrides=True)
        theirs = {name: node.get_parameter(name).value for name in ours}
        node.destroy_node()
        rclpy.shutdown()
    for name, value in ours.items():
        assert type(value) is type(theirs[name]), (lines, name)
        assert value == theirs[name] or (math.isnan(value) and math.isnan(theirs[name]))


def test_a_later_word_on_the_command_line_prevails() -> None:
    with joined("gain:=1.0", "tested:gain:=2.0", "other:gain:=3.0"):
        node = Node("tested")
        assert node.declare_parameter("gain", 0.0).value == 2.0
        node.destroy_node()


def test_names_are_remapped_once_and_their_publishers_found(tmp_path: Path) -> None:
    """Topics that are exchanged for one another are still counted and named right."""
    swapped = [f"{DESIRED.name}:=drive_voltage", f"drive_voltage:={DESIRED.name}", "__ns:=/lab"]
    words = [word for rule in swapped for word in ("-r", rule)]
    given_ = ["-p", f"bag:={tmp_path / 'bag'}"]
    rclpy.init(
        args=["test", "--ros-args", *words, *given_], signal_handler_options=SignalHandlerOptions.NO
    )
    recorder, source = ScanRecorder(), Node("source")
    made = publisher(source, DESIRED)
    assert made.topic_name == "/lab/drive_voltage"
    until(lambda: recorder.count_publishers(made.topic_name) == 1, recorder)
    recorder.pin_publishers()
    pinned = recorder._publishers_of  # noqa: SLF001 - those that the scan is of
    assert [len(pinned[f"/lab/{name}"]) for name in ("drive_voltage", DESIRED.name)] == [1, 0]
    recorder.destroy_node()
    source.destroy_node()
    rclpy.shutdown()


@pytest.mark.skipif(sys.platform != "linux", reason="no other system lists sockets so")
@pytest.mark.parametrize(("reach", "found"), [("LOCALHOST", False), ("SUBNET", True)])
def test_a_node_of_this_machine_alone_listens_to_no_multicast(reach: str, *, found: bool) -> None:
    """By which nodes of other hosts would find it, in any domain whose port this is."""
    given_ = {"ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": reach}
    done = subprocess.run(
        [sys.executable, "-c", PORTS], env={**os.environ, **given_}, check=True, capture_output=True
    )
    ports = json.loads(done.stdout)
    assert any(7410 <= port - 250 * DOMAIN < 7650 for port in ports)
    assert (7400 + 250 * DOMAIN in ports) == found
